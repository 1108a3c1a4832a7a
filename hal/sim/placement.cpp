#include "hal/sim/placement.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace dtact::hal::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
// Distance of the points on which the lowest one of a tilted object is looked for, mm.
constexpr double kSearchStep = 0.05;
constexpr double kSearchEnd = 1e-6;

struct Quaternion {
  double w = 1;
  cv::Vec3d v;
};

Quaternion quaternion_of(const cv::Vec3d& turn_deg) {
  const double angle = cv::norm(turn_deg) * kDegree;
  if (angle == 0) return {};
  return {std::cos(angle / 2), turn_deg * (kDegree * std::sin(angle / 2) / angle)};
}

Quaternion operator*(const Quaternion& a, const Quaternion& b) {
  return {a.w * b.w - a.v.dot(b.v), a.w * b.v + b.w * a.v + a.v.cross(b.v)};
}

std::array<double, 3> vector_of(const Quaternion& q) {
  const double sine = cv::norm(q.v);
  if (sine == 0) return {};
  // Two turns end alike; this is the one of at most 180 degrees.
  const double angle = 2 * std::atan2(sine, std::abs(q.w)) / kDegree;
  const cv::Vec3d v = q.v * ((q.w < 0 ? -angle : angle) / sine);
  return {v[0], v[1], v[2]};
}

cv::Matx33d matrix_of(const Quaternion& q) {
  const double x = q.v[0];
  const double y = q.v[1];
  const double z = q.v[2];
  return {1 - 2 * (y * y + z * z), 2 * (x * y - q.w * z),   2 * (x * z + q.w * y),
          2 * (x * y + q.w * z),   1 - 2 * (x * x + z * z), 2 * (y * z - q.w * x),
          2 * (x * z - q.w * y),   2 * (y * z + q.w * x),   1 - 2 * (x * x + y * y)};
}

// First the turn in the plane, then the tilt.
Quaternion turn_of(const PressKey& key) {
  return quaternion_of({key.tilt_x_deg, key.tilt_y_deg, 0}) *
         quaternion_of({0, 0, key.rotation_deg});
}

bool upright(const PressKey& key) { return key.tilt_x_deg == 0 && key.tilt_y_deg == 0; }

// The height of the lowest point of the turned object over its turned origin, mm; at most 0.
double lowest_mm(const Object& object, const cv::Matx33d& turn) {
  const auto height = [&](double x, double y) {
    return turn(2, 0) * x + turn(2, 1) * y + turn(2, 2) * object.height_mm(x, y);
  };
  double best_x = 0;
  double best_y = 0;
  double best = height(0, 0);
  const auto offer = [&](double x, double y) {
    const double here = height(x, y);
    if (here >= best) return false;
    best = here;
    best_x = x;
    best_y = y;
    return true;
  };
  const int points = static_cast<int>(std::ceil(object.reach_mm / kSearchStep));
  for (int i = -points; i <= points; ++i) {
    for (int j = -points; j <= points; ++j) offer(j * kSearchStep, i * kSearchStep);
  }
  for (double step = kSearchStep; step > kSearchEnd;) {
    bool lower = false;
    const double x = best_x;
    const double y = best_y;
    for (int row = -1; row <= 1; ++row) {
      for (int column = -1; column <= 1; ++column) {
        lower |= offer(x + column * step, y + row * step);
      }
    }
    if (!lower) step /= 2;
  }
  return best;
}

// Where the turned object begins on a line.
class Line {
 public:
  Line(const Object& object, const Pose& pose)
      : object_(object),
        origin_(pose.x_mm, pose.y_mm, pose.z_mm),
        back_(rotation_of(pose.turn_deg).t()) {}

  /// Greatest distance of a point of the sensor's frame outside the object's outline, mm.
  [[nodiscard]] double beside(const cv::Vec3d& point) const {
    const cv::Vec3d p = back_ * (point - origin_);
    return std::hypot(p[0], p[1]) - object_.reach_mm;
  }

  /// How far along the normal from the surface's point, from `low` to `high`; kNoSurface where the
  /// line meets nothing.
  [[nodiscard]] double meets(const SurfacePoint& from, double low, double high, double step) const {
    if (inside(from, low)) return low;
    for (double above = low; above < high;) {
      const double below = above;
      above = std::min(above + step, high);
      if (inside(from, above)) return crossing(from, below, above);
    }
    return kNoSurface;
  }

 private:
  [[nodiscard]] bool inside(const SurfacePoint& from, double along) const {
    const cv::Vec3d p = back_ * (from.at + along * from.normal - origin_);
    // The outline lies within the reach but for rounding.
    if (std::hypot(p[0], p[1]) > object_.reach_mm + 1e-9) return false;
    const double bottom = object_.height_mm(p[0], p[1]);
    if (p[2] < bottom || bottom >= kNoSurface) return false;
    return !object_.top_mm || p[2] <= object_.top_mm(p[0], p[1]);
  }

  [[nodiscard]] double crossing(const SurfacePoint& from, double outside, double within) const {
    while (within - outside > kSearchEnd) {
      const double middle = (outside + within) / 2;
      (inside(from, middle) ? within : outside) = middle;
    }
    return within;
  }

  const Object& object_;
  cv::Vec3d origin_;
  cv::Matx33d back_;
};

void lower_upright(const Object& object, const PressKey& key, const Grid& grid, cv::Mat1d& target) {
  const double angle = key.rotation_deg * kDegree;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  for (int i = 0; i < grid.height; ++i) {
    const double dy = grid.y0_mm + i * grid.spacing_mm - key.y_mm;
    if (std::abs(dy) > object.reach_mm) continue;
    for (int j = 0; j < grid.width; ++j) {
      const double dx = grid.x0_mm + j * grid.spacing_mm - key.x_mm;
      if (std::abs(dx) > object.reach_mm) continue;
      const double height = object.height_mm(c * dx + s * dy, c * dy - s * dx);
      target(i, j) = std::max(target(i, j), key.depth_mm - height);
    }
  }
}

}  // namespace

cv::Matx33d rotation_of(const std::array<double, 3>& turn_deg) {
  return matrix_of(quaternion_of({turn_deg[0], turn_deg[1], turn_deg[2]}));
}

std::optional<PressKey> key_at(const Press& press, double time_s) {
  const auto& keys = press.keys;
  if (time_s < keys.front().time_s) return std::nullopt;
  PressKey key = keys.back();
  const auto next =
      std::upper_bound(keys.begin(), keys.end(), time_s,
                       [](double time, const PressKey& k) { return time < k.time_s; });
  if (next != keys.end()) {
    const PressKey& a = *std::prev(next);
    const double w = (time_s - a.time_s) / (next->time_s - a.time_s);
    key.x_mm = std::lerp(a.x_mm, next->x_mm, w);
    key.y_mm = std::lerp(a.y_mm, next->y_mm, w);
    key.depth_mm = std::lerp(a.depth_mm, next->depth_mm, w);
    key.rotation_deg = std::lerp(a.rotation_deg, next->rotation_deg, w);
    key.tilt_x_deg = std::lerp(a.tilt_x_deg, next->tilt_x_deg, w);
    key.tilt_y_deg = std::lerp(a.tilt_y_deg, next->tilt_y_deg, w);
    key.drag_x_mm = std::lerp(a.drag_x_mm, next->drag_x_mm, w);
    key.drag_y_mm = std::lerp(a.drag_y_mm, next->drag_y_mm, w);
  }
  return key;
}

Pose pose_of(const SurfaceModel& surface, const Object& object, const PressKey& key) {
  const SurfacePoint contact_point = point_at(surface, {key.x_mm, key.y_mm});
  const Quaternion turn = turn_of(key);
  const double lowest = upright(key) ? 0 : lowest_mm(object, matrix_of(turn));
  const cv::Vec3d origin = contact_point.at + (-key.depth_mm - lowest) * contact_point.normal;
  const auto& lean = contact_point.turn_deg;
  return {origin[0], origin[1], origin[2],
          vector_of(quaternion_of({lean[0], lean[1], lean[2]}) * turn)};
}

void lower_object(const SurfaceModel& surface, const Object& object, const PressKey& key,
                  double highest_mm, const Grid& grid, cv::Mat1d& target) {
  if (surface.shape == SurfaceShape::plane && upright(key)) {
    return lower_upright(object, key, grid, target);
  }
  const Line line(object, pose_of(surface, object, key));
  const double span = highest_mm + key.depth_mm;
  const double step = grid.spacing_mm / 4;
  for (int i = 0; i < grid.height; ++i) {
    for (int j = 0; j < grid.width; ++j) {
      const SurfacePoint from =
          point_at(surface, {grid.x0_mm + j * grid.spacing_mm, grid.y0_mm + i * grid.spacing_mm});
      if (line.beside(from.at) > span) continue;
      const double z = line.meets(from, -key.depth_mm, highest_mm, step);
      target(i, j) = std::max(target(i, j), -z);
    }
  }
}

}  // namespace dtact::hal::sim
