#include "tests/accuracy/whole/known_object.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>

namespace dtact::whole {
namespace {

using hal::sim::kNoSurface;

constexpr double kStep = 0.075;  // mm
constexpr double kWall = 1.5;
/// A greater rise is a wall: mm from one point to the next.
constexpr double kRise = 0.25;

using Height = std::function<double(double, double)>;

/// The surface z = height, its outward normal below.
void add_side(const Height& height, double reach, double sign, ObjectCloud& cloud) {
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
      cloud.points.emplace_back(x, y, z);
      cloud.normals.emplace_back(sign * Eigen::Vector3d(dx, dy, -1));
    }
  }
}

void add_walls(const Height& height, double reach, ObjectCloud& cloud) {
  const int steps = static_cast<int>(std::ceil(reach / kStep));
  for (int i = -steps; i <= steps; ++i) {
    for (int k = -steps; k <= steps; ++k) {
      const double x = k * kStep;
      const double y = i * kStep;
      const double z = height(x, y);
      if (z >= kNoSurface) continue;
      double higher = z;
      Eigen::Vector3d outwards = Eigen::Vector3d::Zero();
      constexpr int kAround = 5;
      for (int r = -kAround; r <= kAround; ++r) {
        for (int c = -kAround; c <= kAround; ++c) {
          const double there = height(x + c * kStep, y + r * kStep);
          if (there < z + kRise) continue;
          outwards += Eigen::Vector3d(c, r, 0);
          if (std::abs(r) + std::abs(c) == 1) higher = std::max(higher, there);
        }
      }
      if (higher == z || outwards.norm() == 0) continue;
      const double top = std::min(higher, z + kWall);
      for (double up = z + kStep; up < top; up += kStep) {
        cloud.points.emplace_back(x, y, up);
        cloud.normals.push_back(outwards);
      }
    }
  }
}

}  // namespace

ObjectCloud cloud_of(const hal::sim::Object& object) {
  ObjectCloud cloud;
  add_side(object.height_mm, object.reach_mm, 1, cloud);
  if (object.top_mm) {
    add_side(object.top_mm, object.reach_mm, -1, cloud);
  } else {
    add_walls(object.height_mm, object.reach_mm, cloud);
  }
  return cloud;
}

std::string ply_of(const ObjectCloud& cloud) {
  std::string ply = fmt::format("ply\nformat ascii 1.0\nelement vertex {}\n", cloud.points.size());
  for (const char* property : {"x", "y", "z", "nx", "ny", "nz"}) {
    ply += fmt::format("property float {}\n", property);
  }
  ply += "end_header\n";
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3d& p = cloud.points[i];
    const Eigen::Vector3d n = cloud.normals[i].normalized();
    ply += fmt::format("{:.5f} {:.5f} {:.5f} {:.5f} {:.5f} {:.5f}\n", p.x(), p.y(), p.z(), n.x(),
                       n.y(), n.z());
  }
  return ply;
}

std::string cube_stl(double side_mm) {
  std::string stl = "solid cube\n";
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      normal[axis] = sign;
      const Eigen::Vector3d u = Eigen::Vector3d::Unit((axis + 1) % 3);
      const Eigen::Vector3d v = normal.cross(u);
      const auto corner = [&](double a, double b) -> Eigen::Vector3d {
        return side_mm / 2 * (normal + a * u + b * v + Eigen::Vector3d::UnitZ());
      };
      const std::array<std::array<Eigen::Vector3d, 3>, 2> triangles{
          {{corner(-1, -1), corner(1, -1), corner(1, 1)},
           {corner(-1, -1), corner(1, 1), corner(-1, 1)}}};
      for (const auto& triangle : triangles) {
        stl += "facet normal 0 0 0\nouter loop\n";
        for (const auto& p : triangle) stl += fmt::format("vertex {} {} {}\n", p.x(), p.y(), p.z());
        stl += "endloop\nendfacet\n";
      }
    }
  }
  return stl + "endsolid cube\n";
}

std::vector<Eigen::Isometry3d> cube_symmetries(double side_mm) {
  const Eigen::Translation3d middle(0, 0, side_mm / 2);
  std::vector<Eigen::Isometry3d> found;
  for (int x = 0; x < 3; ++x) {
    for (int y = 0; y < 3; ++y) {
      for (const int signs : {0, 1, 2, 3}) {
        if (x == y) continue;
        Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
        axes(x, 0) = signs % 2 == 0 ? 1 : -1;
        axes(y, 1) = signs / 2 == 0 ? 1 : -1;
        axes.col(2) = axes.col(0).cross(axes.col(1));
        found.push_back(middle * Eigen::Isometry3d(Eigen::AngleAxisd(axes)) * middle.inverse());
      }
    }
  }
  return found;
}

std::vector<Eigen::Isometry3d> symmetries_of(const ObjectCloud& cloud) {
  const auto [low, high] =
      std::ranges::minmax(cloud.points, {}, [](const Eigen::Vector3d& point) { return point.z(); });
  const Eigen::Translation3d middle(0, 0, (low.z() + high.z()) / 2);
  constexpr std::size_t kProbes = 250;
  const std::size_t every = std::max<std::size_t>(1, cloud.points.size() / kProbes);
  const auto stays = [&](const Eigen::Isometry3d& motion) {
    constexpr double kWithin = 0.15;
    std::size_t off = 0;
    for (std::size_t i = 0; i < cloud.points.size(); i += every) {
      const Eigen::Vector3d moved = motion * cloud.points[i];
      const bool met = std::ranges::any_of(cloud.points, [&](const Eigen::Vector3d& other) {
        return (other - moved).squaredNorm() < kWithin * kWithin;
      });
      off += met ? 0 : 1;
    }
    return off <= cloud.points.size() / every / 50;
  };
  std::vector<Eigen::Isometry3d> found;
  for (const bool turned_over : {false, true}) {
    for (int degrees = 0; degrees < 360; ++degrees) {
      // Squares, hexagons, pentagons, and a cap of 36 ribs.
      if (degrees % 15 != 0 && degrees % 72 != 0 && degrees % 10 != 0) continue;
      Eigen::Isometry3d motion(middle);
      motion.rotate(Eigen::AngleAxisd(degrees * M_PI / 180, Eigen::Vector3d::UnitZ()));
      if (turned_over) motion.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
      motion = motion * middle.inverse();
      if (found.empty() || stays(motion)) found.push_back(motion);
    }
  }
  return found;
}

}  // namespace dtact::whole
