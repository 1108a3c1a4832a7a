#include "tests/accuracy/pose/known_object.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>

#include "clients/perceive/pose/object_tracker.hpp"
#include "tests/bench/cpu_time.hpp"

namespace dtact::pose {
namespace {

using hal::sim::kNoSurface;

constexpr double kStep = 0.075;  // mm
constexpr double kWall = 1.5;
/// Steeper than this is a wall: mm from one point to the next.
constexpr double kRise = 0.25;

using Height = std::function<double(double, double)>;

/// z = height, its outward normal below.
void add_side(const Height& height, double reach, double sign, perceive::Mesh& mesh) {
  constexpr double kNear = 1e-3;
  const int steps = static_cast<int>(std::ceil(reach / kStep));
  for (int i = -steps; i <= steps; ++i) {
    for (int k = -steps; k <= steps; ++k) {
      const double x = k * kStep;
      const double y = i * kStep;
      const double z = height(x, y);
      const double dx = (height(x + kNear, y) - height(x - kNear, y)) / (2 * kNear);
      const double dy = (height(x, y + kNear) - height(x, y - kNear)) / (2 * kNear);
      constexpr double kSteepest = 20;
      if (std::abs(z) >= kNoSurface / 2 || std::hypot(dx, dy) > kSteepest) continue;
      mesh.points.push_back({x, y, z});
      mesh.normals.push_back({sign * dx, sign * dy, -sign});
    }
  }
}

void add_walls(const Height& height, double reach, perceive::Mesh& mesh) {
  const int steps = static_cast<int>(std::ceil(reach / kStep));
  for (int i = -steps; i <= steps; ++i) {
    for (int k = -steps; k <= steps; ++k) {
      const double x = k * kStep;
      const double y = i * kStep;
      const double z = height(x, y);
      if (z >= kNoSurface) continue;
      double higher = z;
      Eigen::Vector2d outwards = Eigen::Vector2d::Zero();
      constexpr int kAround = 5;
      for (int r = -kAround; r <= kAround; ++r) {
        for (int c = -kAround; c <= kAround; ++c) {
          const double there = height(x + c * kStep, y + r * kStep);
          if (there < z + kRise) continue;
          outwards += Eigen::Vector2d(c, r);
          if (std::abs(r) + std::abs(c) == 1) higher = std::max(higher, there);
        }
      }
      if (higher == z || outwards.norm() == 0) continue;
      const double top = std::min(higher, z + kWall);
      for (double up = z + kStep; up < top; up += kStep) {
        mesh.points.push_back({x, y, up});
        mesh.normals.push_back({outwards.x(), outwards.y(), 0});
      }
    }
  }
}

}  // namespace

perceive::Mesh cloud_of(const hal::sim::Object& object) {
  perceive::Mesh mesh;
  add_side(object.height_mm, object.reach_mm, 1, mesh);
  if (object.top_mm) {
    add_side(object.top_mm, object.reach_mm, -1, mesh);
  } else {
    add_walls(object.height_mm, object.reach_mm, mesh);
  }
  return mesh;
}

std::vector<perceive::Motion> symmetries_of(const perceive::ObjectModel& object) {
  // About the middle of height, for half a turn about x.
  double low = INFINITY;
  double high = -INFINITY;
  for (const auto& surfel : object.surfels) {
    low = std::min(low, surfel.point.z());
    high = std::max(high, surfel.point.z());
  }
  const Eigen::Vector3d middle(0, 0, (low + high) / 2);
  constexpr std::size_t kProbes = 250;
  const std::size_t every = std::max<std::size_t>(1, object.surfels.size() / kProbes);
  const auto stays = [&](const perceive::Motion& motion) {
    const double limit = 1.2 * object.spacing;
    std::size_t off = 0;
    for (std::size_t i = 0; i < object.surfels.size(); i += every) {
      const Eigen::Vector3d moved = motion * object.surfels[i].point;
      const bool met = std::ranges::any_of(object.surfels, [&](const auto& other) {
        return (other.point - moved).squaredNorm() < limit * limit;
      });
      off += met ? 0 : 1;
    }
    return off <= object.surfels.size() / every / 50;
  };
  std::vector<perceive::Motion> found;
  for (const bool turned_over : {false, true}) {
    for (int degrees = 0; degrees < 360; ++degrees) {
      // Squares, hexagons, pentagons, and a cap of 36 ribs.
      if (degrees % 15 != 0 && degrees % 72 != 0 && degrees % 10 != 0) continue;
      perceive::Motion motion;
      motion.rotation =
          Eigen::AngleAxisd(degrees * M_PI / 180, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      if (turned_over) {
        motion.rotation *= Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix();
      }
      motion.translation = middle - motion.rotation * middle;
      if (found.empty() || stays(motion)) found.push_back(motion);
    }
  }
  return found;
}

KnownResult follow_known(const std::string& object, const Way& way, int steps,
                         const recon::Surface& surface) {
  using State = perceive::Tracker::State;
  Sequence frames(object, keys_of(way, steps), surface);
  const auto model = std::make_shared<const perceive::ObjectModel>(
      perceive::make_object(cloud_of(frames.object()), 1e-3, object));
  const auto symmetries = symmetries_of(*model);
  perceive::ObjectTracker tracker(model);
  perceive::CloudMaker maker(surface);
  perceive::PointCloud cloud;
  KnownResult result;
  for (int step = 0; step <= steps; ++step) {
    const auto sequence = static_cast<std::uint64_t>(step * 2 * Sequence::kFps / steps);
    const Map map = frames.map(sequence);
    const double before = bench::thread_us();
    maker.make(map.grid, 1, cloud);
    const perceive::ContactView view(map.grid, cloud, maker.table(), 10);
    (void)tracker.follow(view, sequence);
    result.frame_us.push_back(bench::thread_us() - before);
    if (step == 0) {
      const double from = bench::thread_us();
      (void)perceive::search(*model, perceive::make_patch(view));
      result.search_ms = 1e-3 * (bench::thread_us() - from);
    }
    if (tracker.is_searching()) {
      tracker.wait();
      (void)tracker.follow(view, sequence);
    }
    ++result.frames;
    const auto& pose = tracker.pose();
    if (pose.state == State::searching || pose.state == State::lost) {
      ++result.unplaced;
      continue;
    }
    const perceive::Alignment& found = pose.alignment;
    const perceive::Motion truth = frames.place(sequence);
    double um = INFINITY;
    double degrees = INFINITY;
    const auto cost = [&found](double a, double b) { return a + 1e6 * found.arm * b * M_PI / 180; };
    for (const perceive::Motion& symmetry : symmetries) {
      perceive::Twist off =
          perceive::screw_of(found.motion * (truth * symmetry).inverse(), found.centre, found.arm);
      for (const perceive::Twist& hidden : found.unobservable) off -= hidden * hidden.dot(off);
      const double this_um = 1e6 * off.tail<3>().norm();
      const double this_deg = off.head<3>().norm() / found.arm * 180 / M_PI;
      if (cost(this_um, this_deg) >= cost(um, degrees)) continue;
      um = this_um;
      degrees = this_deg;
    }
    if (result.um.empty()) {
      result.first_um = um;
      result.first_deg = degrees;
      result.alternatives = pose.alternatives;
      result.hidden = found.unobservable.size();
    }
    constexpr double kOtherUm = 500;
    constexpr double kOtherDeg = 10;
    if (um > kOtherUm || degrees > kOtherDeg) ++result.others;
    result.um.push_back(um);
    result.degrees.push_back(degrees);
  }
  return result;
}

}  // namespace dtact::pose
