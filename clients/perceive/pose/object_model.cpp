#include "clients/perceive/pose/object_model.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <unordered_set>
#include <utility>

namespace dtact::perceive {
namespace {

using Eigen::Vector3d;

constexpr double kSpacing = 1.5e-4;
/// Samples in the area of a surfel before they are thinned: few cells stay empty.
constexpr double kSamplesPerSurfel = 6;
/// Rests that are nearer to each other than this cosine (4°) are one; some hundreds are looked for.
constexpr double kSameRest = 0.9976;
constexpr int kDropped = 400;
constexpr std::size_t kMaxRests = 100;

Vector3d point_of(const std::array<double, 3>& values, double scale) {
  return scale * Vector3d(values[0], values[1], values[2]);
}

void check_size(const Eigen::AlignedBox3d& box) {
  const double mm = 1e3 * box.diagonal().norm();
  if (mm >= kMinObjectMm && mm <= kMaxObjectMm) return;
  throw std::runtime_error(fmt::format(
      "the object is {:.3g} mm across, where {} to {} mm can be felt: is its unit another one?", mm,
      kMinObjectMm, kMaxObjectMm));
}

/// Keeps one surfel per cell and direction (axis and sign of the normal's largest component), so
/// that thin walls keep both sides.
class Thinner {
 public:
  Thinner(double cell, const Vector3d& corner) : cell_(cell), corner_(corner) {}

  void offer(const Surfel& surfel) {
    Eigen::Index axis = 0;
    surfel.normal.cwiseAbs().maxCoeff(&axis);
    std::uint64_t key = 2 * static_cast<std::uint64_t>(axis) + (surfel.normal[axis] > 0 ? 1 : 0);
    for (const double place : Vector3d((surfel.point - corner_) / cell_)) {
      // 300 mm are 2000 cells.
      key = (key << 16U) | static_cast<std::uint64_t>(place);
    }
    if (seen_.insert(key).second) kept_.push_back(surfel);
  }
  [[nodiscard]] std::vector<Surfel>& kept() noexcept { return kept_; }

 private:
  double cell_;
  Vector3d corner_;
  std::unordered_set<std::uint64_t> seen_;
  std::vector<Surfel> kept_;
};

/// Spreads points evenly over each triangle (Martin Roberts' plastic number sequence), as many as
/// its area needs, carrying fractions on. Deterministic: the same mesh gives the same points.
std::vector<Surfel> sample(const Mesh& mesh, double scale, double spacing, const Vector3d& corner) {
  Thinner thinner(spacing, corner);
  constexpr double kFirst = 0.7548776662466927;
  constexpr double kSecond = 0.5698402909980532;
  double owed = 0;
  double u = 0.5;
  double v = 0.5;
  for (const auto& triangle : mesh.triangles) {
    const Vector3d a = point_of(mesh.points[triangle[0]], scale);
    const Vector3d ab = point_of(mesh.points[triangle[1]], scale) - a;
    const Vector3d ac = point_of(mesh.points[triangle[2]], scale) - a;
    const Vector3d across = ab.cross(ac);
    const double twice = across.norm();
    if (!(twice > 0)) continue;
    const Vector3d inwards = -across / twice;
    owed += kSamplesPerSurfel * twice / 2 / (spacing * spacing);
    while (owed >= 1) {
      owed -= 1;
      u = std::fmod(u + kFirst, 1.0);
      v = std::fmod(v + kSecond, 1.0);
      const bool beyond = u + v > 1;
      thinner.offer({a + (beyond ? 1 - u : u) * ab + (beyond ? 1 - v : v) * ac, inwards});
    }
  }
  return std::move(thinner.kept());
}

std::vector<Surfel> thin(const Mesh& mesh, double scale, double spacing, const Vector3d& corner) {
  Thinner thinner(spacing, corner);
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const Vector3d normal = point_of(mesh.normals[i], 1);
    const double length = normal.norm();
    if (length > 0) thinner.offer({point_of(mesh.points[i], scale), -normal / length});
  }
  return std::move(thinner.kept());
}

double area_of(const Mesh& mesh, double scale) {
  double area = 0;
  for (const auto& triangle : mesh.triangles) {
    const Vector3d a = point_of(mesh.points[triangle[0]], scale);
    const Vector3d ab = point_of(mesh.points[triangle[1]], scale) - a;
    const Vector3d ac = point_of(mesh.points[triangle[2]], scale) - a;
    area += ab.cross(ac).norm() / 2;
  }
  return area;
}

/// Lets it tumble until its middle is as low as it gets, from each of many directions.
class Tumble {
 public:
  explicit Tumble(const std::vector<Surfel>& surfels) {
    Vector3d middle = Vector3d::Zero();
    for (const Surfel& surfel : surfels) {
      middle += surfel.point / static_cast<double>(surfels.size());
    }
    // Only those count that are the furthest out in some direction.
    std::vector<std::uint8_t> furthest(surfels.size());
    for (const Vector3d& direction : all_directions(kDirections)) {
      double most = -INFINITY;
      std::size_t best = 0;
      for (std::size_t i = 0; i < surfels.size(); ++i) {
        const double out = direction.dot(surfels[i].point);
        if (out <= most) continue;
        most = out;
        best = i;
      }
      furthest[best] = 1;
    }
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      if (furthest[i] != 0) points_.emplace_back(surfels[i].point - middle);
    }
  }

  /// Where `direction` looks down at first; where it does in the end.
  [[nodiscard]] Vector3d fall(Vector3d direction) const {
    double height = height_of(direction);
    constexpr double kFirst = 0.1;
    constexpr double kLast = 5e-4;
    for (double step = kFirst; step > kLast;) {
      const Vector3d side = direction.unitOrthogonal();
      const Vector3d other = direction.cross(side);
      bool lower = false;
      for (int i = 0; i < 8; ++i) {
        const double angle = std::numbers::pi / 4 * i;
        const Vector3d tried =
            (direction + step * (std::cos(angle) * side + std::sin(angle) * other)).normalized();
        const double there = height_of(tried);
        if (there >= height) continue;
        height = there;
        direction = tried;
        lower = true;
        break;
      }
      if (!lower) step /= 2;
    }
    return direction;
  }

 private:
  static constexpr int kDirections = 1600;

  /// Height of the middle above the plane.
  [[nodiscard]] double height_of(const Vector3d& direction) const {
    double most = 0;
    for (const Vector3d& point : points_) most = std::max(most, direction.dot(point));
    return most;
  }

  std::vector<Vector3d> points_;
};

std::vector<Vector3d> rests_of(const std::vector<Surfel>& surfels) {
  const Tumble tumble(surfels);
  std::vector<Vector3d> rests;
  for (const Vector3d& direction : all_directions(kDropped)) {
    const Vector3d rest = tumble.fall(direction);
    const bool known = std::ranges::any_of(
        rests, [&](const Vector3d& other) { return other.dot(rest) > kSameRest; });
    if (!known && rests.size() < kMaxRests) rests.push_back(rest);
  }
  return rests;
}

/// For a closed surface the mean outward component is positive for any origin.
void check_outward(const std::vector<Surfel>& surfels, const Vector3d& middle) {
  double outward = 0;
  double all = 0;
  for (const Surfel& surfel : surfels) {
    const double part = -surfel.normal.dot(surfel.point - middle);
    outward += part;
    all += std::abs(part);
  }
  constexpr double kInwards = -0.2;
  if (outward < kInwards * all) {
    throw std::runtime_error(
        "the object's surface looks inwards: turn its normals (its faces' winding) round");
  }
}

}  // namespace

std::vector<Vector3d> all_directions(int count) {
  std::vector<Vector3d> all;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1) / static_cast<double>(count);
    const double angle = 2 * std::numbers::pi * i / std::numbers::phi;
    const double r = std::sqrt(1 - z * z);
    all.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
  }
  return all;
}

ObjectModel make_object(const Mesh& mesh, double metres_per_unit, std::string name) {
  Eigen::AlignedBox3d box;
  for (const auto& point : mesh.points) box.extend(point_of(point, metres_per_unit));
  check_size(box);
  ObjectModel model;
  model.name = std::move(name);
  const bool cloud = mesh.triangles.empty();
  model.spacing = kSpacing;
  if (!cloud) {
    const double area = area_of(mesh, metres_per_unit);
    model.spacing = std::max(kSpacing, std::sqrt(area / static_cast<double>(kMaxSurfels)));
  }
  // A surface that lies across the cells meets more of them than its area says.
  for (;; model.spacing *= 1.2) {
    model.surfels = cloud ? thin(mesh, metres_per_unit, model.spacing, box.min())
                          : sample(mesh, metres_per_unit, model.spacing, box.min());
    // A cloud's own gaps must not become holes either: two of its points for each one kept.
    const bool sparse = cloud && mesh.points.size() < 2 * model.surfels.size();
    if (model.surfels.size() <= kMaxSurfels && !sparse) break;
    if (sparse && model.spacing > kCoarse) {
      const double each =
          static_cast<double>(model.surfels.size()) / static_cast<double>(mesh.points.size());
      throw std::runtime_error(
          fmt::format("the cloud's points are about {:.2g} mm apart, at most {} mm is needed: a "
                      "denser cloud, or a mesh",
                      1e3 * model.spacing * std::sqrt(each), 1e3 * kSpacing));
    }
  }
  constexpr std::size_t kFewest = 50;
  if (model.surfels.size() < kFewest) {
    throw std::runtime_error(
        fmt::format("the object has {} places {:.2f} mm apart, {} are needed: a denser cloud, or a "
                    "mesh that has areas",
                    model.surfels.size(), 1e3 * model.spacing, kFewest));
  }
  check_outward(model.surfels, box.center());
  model.rests = rests_of(model.surfels);
  return model;
}

}  // namespace dtact::perceive
