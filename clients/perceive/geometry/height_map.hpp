#pragma once

#include <optional>
#include <vector>

#include "clients/perceive/geometry/vector.hpp"
#include "daemon/recon/surface.hpp"

namespace dtact::perceive {

/// A surface between the nodes of its heights: the cubic convolution of Keys, "Cubic convolution
/// interpolation for digital image processing", 1981, in both directions. Its slopes are
/// continuous. Where a cell has no node on one side his condition continues the grid there:
/// f(−1) = 3 f(0) − 3 f(1) + f(2).
class HeightMap {
 public:
  /// Throws std::invalid_argument unless the sizes fit each other, from 4 nodes along each side on.
  explicit HeightMap(const recon::SurfaceHeights& heights);

  struct Height {
    double z_mm = 0;
    double slope_x = 0;
    double slope_y = 0;
  };
  /// Nothing beside the grid.
  [[nodiscard]] std::optional<Height> at(double x_mm, double y_mm) const;

  /// The least t ≥ 0 at which from + t · direction (millimetres; upwards, and away from the z axis
  /// or along it) reaches the surface from below. Nothing where it leaves the grid before, or
  /// begins above the surface.
  [[nodiscard]] std::optional<double> reached(const Vector& from, const Vector& direction) const;

 private:
  /// How far above the surface a point is, and the surface's height below it.
  struct Above {
    double mm = 0;
    Height height;
  };
  [[nodiscard]] Above above(const Vector& point) const;
  [[nodiscard]] Height inside(double x_mm, double y_mm) const;

  int columns_;  ///< Nodes.
  int rows_;
  double spacing_mm_;
  double half_width_mm_;  ///< From the middle to the outermost nodes.
  double half_height_mm_;
  std::vector<double> z_mm_;  ///< With the continuation: a node more on all sides.
  double low_mm_ = 0;         ///< No point of the surface is lower, and none …
  double high_mm_ = 0;        ///< … higher.
};

}  // namespace dtact::perceive
