#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "clients/perceive/geometry/surface_table.hpp"

namespace dtact::perceive {

/// Indentation as dtact.v1.DepthMap says it: columns x … x + width − 1 and rows y … y + height − 1
/// of a map of full_width × full_height.
struct DepthGrid {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
  int full_width = 0;
  int full_height = 0;
  double mm_per_px = 0;
  double um_per_unit = 1;
  int untrusted = -32768;
  std::span<const std::int16_t> values;  ///< Row-major.
};

/// The deformed surface as points with outward normals, in the surface frame, on the map's grid:
/// the four neighbours of a point are known, and with them the mesh, see for_each_triangle().
struct PointCloud {
  int width = 0;
  int height = 0;
  /// Of the first point and from one to the next, in pixels of the whole depth map.
  int x = 0;
  int y = 0;
  int stride = 1;
  /// x, y, z (metres), then the normal's x, y, z: six arrays of width · height, row-major. Where
  /// there is no point all six are NaN.
  std::vector<float> values;

  enum Part : std::uint8_t { kX, kY, kZ, kNormalX, kNormalY, kNormalZ, kParts };
  [[nodiscard]] std::size_t size() const noexcept {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  [[nodiscard]] std::span<const float> part(Part part) const noexcept {
    return std::span(values).subspan(part * size(), size());
  }
  /// There is a point at this index.
  [[nodiscard]] bool has(std::size_t index) const noexcept {
    return values[index] == values[index];  // not NaN
  }
};

/// Makes point clouds of depth maps that belong to one surface. Its tables are made at the first
/// map of a size; it allocates at no later one of it.
class CloudMaker {
 public:
  explicit CloudMaker(const recon::Surface& surface = {}) : surface_(surface) {}

  /// Every `stride`-th pixel of the whole map along both sides, the same ones whatever part of it
  /// `depth` is. A point is the surface's less indentation · normal; its own normal is the cross
  /// product of the differences over kReachMm on both sides, or as far as there are trusted pixels
  /// of the map. A pixel that has no such neighbour in its row, or none in its column, is left out,
  /// and so is an untrusted one. Throws std::invalid_argument for sizes that contradict each other
  /// and for a stride below 1.
  void make(const DepthGrid& depth, int stride, PointCloud& out);

  [[nodiscard]] const recon::Surface& surface() const noexcept { return surface_; }
  /// Of the maps made last; null for a plane.
  [[nodiscard]] const SurfaceTable* table() const noexcept {
    return surface_.kind == recon::Surface::Kind::plane ? nullptr : &table_;
  }

  /// Less lets the depth's noise into the normals, more blurs edges.
  static constexpr double kReachMm = 0.16;

 private:
  /// Where the parts of the row that is being made go.
  using Row = std::array<float*, PointCloud::kParts>;

  void read(const DepthGrid& depth);
  void flat_row(const DepthGrid& depth, int row, int reach, const Row& out) const;
  void curved_row(const DepthGrid& depth, int row, int reach, const Row& out) const;
  void mend(const DepthGrid& depth, int row, int column, int reach, const Row& out) const;
  [[nodiscard]] Vector point(const DepthGrid& depth, int row, int column) const;
  [[nodiscard]] float depth_at(const DepthGrid& depth, int row, int column) const {
    return depth_[static_cast<std::size_t>(row) * static_cast<std::size_t>(depth.width) +
                  static_cast<std::size_t>(column)];
  }

  recon::Surface surface_;
  SurfaceTable table_;         ///< Empty for a plane.
  std::vector<float> depth_;   ///< Metres, NaN where untrusted.
  std::vector<float> points_;  ///< Of a curved surface: x, y and z of all.
  std::vector<float> row_;     ///< The row being made, of which a stride takes some.
};

/// Calls back(a, b, c) with the indices of each triangle, counter-clockwise as seen from outside:
/// two for each square of neighbours, those whose three points are there.
template <typename Back>
void for_each_triangle(const PointCloud& cloud, Back back) {
  const auto width = static_cast<std::size_t>(cloud.width);
  for (std::size_t row = 0; row + 1 < static_cast<std::size_t>(cloud.height); ++row) {
    for (std::size_t column = 0; column + 1 < width; ++column) {
      const std::size_t i = row * width + column;
      const std::size_t right = i + 1;
      const std::size_t below = i + width;
      if (!cloud.has(right) || !cloud.has(below)) continue;
      if (cloud.has(i)) back(i, right, below);
      if (cloud.has(below + 1)) back(right, below + 1, below);
    }
  }
}

}  // namespace dtact::perceive
