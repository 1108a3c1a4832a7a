#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <deque>
#include <memory>
#include <random>
#include <vector>

#include "clients/perceive/pose/contact_view.hpp"
#include "clients/perceive/pose/object_model.hpp"
#include "clients/perceive/pose/tracker.hpp"

namespace dtact::perceive::test {

/// A rigid object of balls. Its indentation is known exactly everywhere: that of the deepest ball.
struct Balls {
  struct Ball {
    Eigen::Vector3d middle;  ///< Millimetres, surface frame.
    double radius = 0;
  };
  std::vector<Ball> balls;
};

/// Four balls of 1.5 to 2.5 mm: every motion changes their surface.
inline Balls bumps() {
  return {{{{-1.3, -0.9, 0.95}, 1.5},
           {{1.2, -1.1, 1.5}, 2.0},
           {{0.2, 1.3, 1.9}, 2.5},
           {{2.2, 1.2, 1.1}, 1.5}}};
}

/// A cloud of `points` points on each ball's part of the common surface, millimetres.
inline Mesh cloud_of(const Balls& object, int points = 20000) {
  Mesh mesh;
  for (const auto& ball : object.balls) {
    for (const Eigen::Vector3d& out : all_directions(points)) {
      const Eigen::Vector3d point = ball.middle + ball.radius * out;
      const bool within = std::ranges::any_of(object.balls, [&](const auto& other) {
        return (point - other.middle).norm() < other.radius - 1e-6;
      });
      if (within) continue;
      mesh.points.push_back({point.x(), point.y(), point.z()});
      mesh.normals.push_back({out.x(), out.y(), out.z()});
    }
  }
  return mesh;
}

/// A model of that cloud, named "balls".
inline std::shared_ptr<const ObjectModel> model_of(const Balls& object) {
  return std::make_shared<const ObjectModel>(make_object(cloud_of(object), 1e-3, "balls"));
}

/// Curved sensors whose field of 8 mm falls by half a millimetre and more.
inline std::vector<recon::Surface> curved() {
  return {{recon::Surface::Kind::sphere, 15, 0, 20, 8, 1.41},
          {recon::Surface::Kind::cylinder, 12, 30, 20, 8, 1.41}};
}

/// Turns by `degrees` about `axis` through the origin and then shifts by `mm`.
inline Motion moved(const Eigen::Vector3d& mm,
                    const Eigen::Vector3d& axis = Eigen::Vector3d::UnitZ(), double degrees = 0) {
  return Eigen::Translation3d(mm * 1e-3) *
         Motion(Eigen::AngleAxisd(degrees * M_PI / 180, axis.normalized()));
}

/// Indentation of the balls after `motion` where the camera's ray meets them, millimetres.
inline double indentation_mm(const Balls& object, const Motion& motion, const SurfacePoint& at) {
  const Eigen::Vector3d ray(at.ray.data());
  double depth = 0;
  for (const auto& ball : object.balls) {
    // The ray leaves the ball here, going inwards.
    const Eigen::Vector3d from =
        1e3 * (Eigen::Vector3d(at.point.data()) - motion * (1e-3 * ball.middle));
    const double over = from.dot(ray);
    const double rest =
        over * over - ray.squaredNorm() * (from.squaredNorm() - ball.radius * ball.radius);
    if (rest > 0) depth = std::max(depth, (over + std::sqrt(rest)) / ray.squaredNorm());
  }
  return depth;
}

/// Pixels of a map, wider than high.
constexpr int kWidth = 176;
constexpr int kHeight = 160;
constexpr double kPx = 0.05;

/// Data that is the same in all frames on a surface: casting the rays takes long.
struct Gel {
  explicit Gel(const recon::Surface& surface) : maker(surface) {
    for (int row = 0; row < kHeight; ++row) {
      for (int column = 0; column < kWidth; ++column) {
        pixels.push_back(cast_ray(surface, (column - 0.5 * (kWidth - 1)) * kPx,
                                  (row - 0.5 * (kHeight - 1)) * kPx)
                             .value());
      }
    }
  }
  CloudMaker maker;
  std::vector<SurfacePoint> pixels;
};
/// The same object for the same surface.
inline Gel& gel_of(const recon::Surface& surface) {
  static std::deque<Gel> all;
  for (Gel& one : all) {
    if (one.maker.surface() == surface) return one;
  }
  return all.emplace_back(surface);
}

/// Means over 7 × 7 pixels of a map.
inline std::vector<double> blurred(const std::vector<double>& map) {
  constexpr int kReach = 3;
  std::vector<double> rows(map.size());
  std::vector<double> all(map.size());
  const auto mean = [](const std::vector<double>& from, std::vector<double>& to, int count,
                       int step, int lines, int across) {
    for (int line = 0; line < lines; ++line) {
      for (int i = 0; i < count; ++i) {
        double sum = 0;
        for (int k = i - kReach; k <= i + kReach; ++k) {
          sum += from[static_cast<std::size_t>(line * across + std::clamp(k, 0, count - 1) * step)];
        }
        to[static_cast<std::size_t>(line * across + i * step)] = sum / (2 * kReach + 1);
      }
    }
  };
  mean(map, rows, kWidth, 1, kHeight, kWidth);
  mean(rows, all, kHeight, kWidth, kWidth, 1);
  return all;
}

/// One frame: the map, its points and the view of them.
struct Frame {
  /// The balls after `motion` in `surface`, with `noise_um` of noise that is correlated over some
  /// pixels, like the daemon's after smoothing.
  Frame(const Balls& object, const Motion& motion, double noise_um = 0, unsigned seed = 1,
        const recon::Surface& surface = {})
      : Frame([&](const SurfacePoint& at) { return indentation_mm(object, motion, at); }, noise_um,
              seed, surface) {}
  /// `depth_mm` gives the indentation of each pixel's point of the surface.
  template <std::invocable<const SurfacePoint&> Depth>
  explicit Frame(Depth depth_mm, double noise_um = 0, unsigned seed = 1,
                 const recon::Surface& surface = {})
      : gel(gel_of(surface)) {
    values.resize(std::size_t{kWidth} * kHeight);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<double> noise(values.size());
    for (double& one : noise) one = normal(random);
    std::vector<double> depths;
    depths.reserve(values.size());
    for (const SurfacePoint& pixel : gel.pixels) depths.push_back(depth_mm(pixel));
    // A gel has no kink at a contact's rim, and the camera sees none: light scatters in it over
    // 0.2 mm. Two means over 7 pixels of 0.05 mm are as wide.
    for (int pass = 0; pass < 2; ++pass) depths = blurred(depths);
    for (int row = 0; row < kHeight; ++row) {
      for (int column = 0; column < kWidth; ++column) {
        double depth = depths[static_cast<std::size_t>(row * kWidth + column)];
        double error = 0;
        int count = 0;
        for (int r = std::max(0, row - 1); r <= std::min(kHeight - 1, row + 1); ++r) {
          for (int c = std::max(0, column - 1); c <= std::min(kWidth - 1, column + 1);
               ++c, ++count) {
            error += noise[static_cast<std::size_t>(r * kWidth + c)];
          }
        }
        // The mean of n values has 1/√n of their deviation.
        depth += 1e-3 * noise_um * error / std::sqrt(count);
        values[static_cast<std::size_t>(row * kWidth + column)] =
            static_cast<std::int16_t>(std::lround(1000 * depth));
      }
    }
    grid.width = grid.full_width = kWidth;
    grid.height = grid.full_height = kHeight;
    grid.mm_per_px = kPx;
    grid.values = values;
    gel.maker.make(grid, 1, cloud);
  }
  [[nodiscard]] ContactView view(double uncertainty_um = 10) const {
    return ContactView(grid, cloud, gel.maker.table(), uncertainty_um);
  }

  std::vector<std::int16_t> values;
  DepthGrid grid;
  Gel& gel;
  PointCloud cloud;
};

/// The same frame of a plane as a coarser map: means of `times` × `times` pixels.
struct CoarseFrame {
  CoarseFrame(const Frame& fine, int times) {
    grid.width = grid.full_width = kWidth / times;
    grid.height = grid.full_height = kHeight / times;
    for (int row = 0; row < grid.height; ++row) {
      for (int column = 0; column < grid.width; ++column) {
        int sum = 0;
        for (int i = 0; i < times * times; ++i) {
          const int r = row * times + i / times;
          const int c = column * times + i % times;
          sum += fine.values[static_cast<std::size_t>(r * kWidth + c)];
        }
        values.push_back(static_cast<std::int16_t>(sum / (times * times)));
      }
    }
    grid.mm_per_px = kPx * times;
    grid.values = values;
    CloudMaker().make(grid, 1, cloud);
  }
  [[nodiscard]] ContactView view() const { return ContactView(grid, cloud, nullptr, 10); }

  std::vector<std::int16_t> values;
  DepthGrid grid;
  PointCloud cloud;
};

/// Distance of `found` from `truth` at the contact: rotation in degrees and the shift of the
/// contact's centre in micrometres, without the unobservable directions.
struct Error {
  double degrees = 0;
  double um = 0;
};
inline Error error_of(const Alignment& found, const Motion& truth) {
  const Eigen::Matrix3d turn = found.motion.linear() * truth.linear().transpose();
  const Eigen::AngleAxisd angle(turn);
  Twist twist;
  // The position in `truth` of the point that is found at the centre.
  const Eigen::Vector3d there = truth * (found.motion.inverse() * found.centre);
  twist << found.arm * angle.angle() * angle.axis(), found.centre - there;
  for (const Twist& one : unobservable_of(found.covariance, found.centre, found.arm)) {
    twist -= one * one.dot(twist);
  }
  return {twist.head<3>().norm() / found.arm * 180 / M_PI, twist.tail<3>().norm() * 1e6};
}

}  // namespace dtact::perceive::test
