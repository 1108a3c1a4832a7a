#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "clients/geometry/surface_table.hpp"

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
  /// Position of the first point and step to the next, in pixels of the whole depth map.
  int x = 0;
  int y = 0;
  int stride = 1;
  /// x, y, z (metres), then the normal's x, y, z: six arrays of width · height, row-major. Where
  /// there is no point all six are NaN.
  std::vector<float> values;
  /// For CloudMaker: the part of `values` that its next call may leave unchanged. Code that
  /// changes `values` must clear it.
  struct Drawn {
    std::uint64_t tables = 0;  ///< Which surface and whole map; 0: nothing is known.
    /// Bits of a row's tiles: which hold the undeformed surface's …
    struct Row {
      std::uint64_t rest = 0;    ///< … points and normals, …
      std::uint64_t placed = 0;  ///< … points, of a curved surface.
    };
    std::vector<Row> rows;
  } drawn;

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

/// Makes point clouds from depth maps of one surface. The first map of each size makes a table.
/// Tables of the last three sizes are kept: a sensor's full, half and quarter resolution, which may
/// change between two frames. Points that are outside the contact, and were so in the last call for
/// the same part of a map, stay unchanged in `out`.
class CloudMaker {
 public:
  explicit CloudMaker(const recon::Surface& surface = {}) : surface_(surface) {}

  /// Takes every `stride`-th pixel of the whole map along both sides, independent of the part that
  /// `depth` covers. A point is the surface point − indentation · normal. Its normal is the cross
  /// product of the differences over kReachMm on both sides, or to the last trusted pixel.
  /// Untrusted pixels, and those without a trusted neighbour in their row or in their column, are
  /// left out. Throws std::invalid_argument for sizes that contradict each other and for a stride
  /// below 1.
  void make(const DepthGrid& depth, int stride, PointCloud& out);

  [[nodiscard]] const recon::Surface& surface() const noexcept { return surface_; }
  /// Table of the last map, valid until a map of another size; null for a plane.
  [[nodiscard]] const SurfaceTable* table() const noexcept {
    return flat() || tables_.empty() ? nullptr : &tables_.front().table;
  }

  /// Less lets the depth's noise into the normals, more blurs edges.
  static constexpr double kReachMm = 0.16;

 private:
  /// A cloud that is being made.
  struct Work;
  struct Numbered {
    SurfaceTable table;        ///< For a plane only the sizes.
    std::uint64_t number = 0;  ///< As PointCloud::Drawn says it.
  };

  [[nodiscard]] bool flat() const noexcept { return surface_.kind == recon::Surface::Kind::plane; }
  void prepare(const DepthGrid& depth);
  void make_whole(const DepthGrid& depth, PointCloud& out);
  [[nodiscard]] std::uint64_t resting(const Work& work, int row) const;
  void make_row(const Work& work, int row);
  void press_row(const Work& work, int row) const;
  void make_part(const Work& work, int row, int begin, int end);
  void fix(const Work& work, int row, int column);
  void erase_lone(const Work& work) const;
  [[nodiscard]] Vector point(const Work& work, int row, int column) const;

  recon::Surface surface_;
  std::vector<Numbered> tables_;        ///< The first is that of the last map.
  std::vector<std::uint64_t> pressed_;  ///< For each row: bits of the tiles with depth ≠ 0.
  std::vector<std::size_t> lone_;       ///< Points that turned out to have no normal.
  PointCloud whole_;                    ///< The cloud before the stride is applied.
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
