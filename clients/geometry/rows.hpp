#pragma once

#include <cstddef>
#include <cstdint>

namespace dtact::perceive {

// Plain loops over a row's pixels that -O3 turns into vector code. Nothing is contracted, so that
// they give the same bits on every processor.

/// Bit k: whether a value of [k · tile, (k + 1) · tile) is not 0. A tile is a multiple of
/// kTilePixels; there are at most 64.
inline constexpr int kTilePixels = 32;
[[nodiscard]] std::uint64_t pressed_tiles(const std::int16_t* values, int width, int tile) noexcept;

/// How many of them are NaN.
[[nodiscard]] int count_holes(const float* values, int count) noexcept;

/// Depth in values: metres are value · metres; `untrusted` is none.
struct DepthUnit {
  float metres = 0;
  int untrusted = 0;
};

/// The largest size of all that are not NaN; 0 when there is none.
[[nodiscard]] float largest(const float* values, std::size_t count) noexcept;

/// The nearest whole number to value · per_unit, within ±32767; −32768 for NaN.
void quantise(const float* values, std::size_t count, float per_unit, std::int16_t* out) noexcept;

/// point − depth · ray of one axis; NaN where untrusted.
void press(const float* point, const float* ray, const std::int16_t* depth, DepthUnit unit,
           int count, float* out) noexcept;

/// A row and the range of its pixels to compute. Neighbours are `reach` pixels away along the row,
/// or at its ends; `above` and `below` are the offsets to the others, in values.
struct RowPart {
  int width = 0;
  int reach = 0;
  std::ptrdiff_t above = 0;
  std::ptrdiff_t below = 0;
  int begin = 0;
  int end = 0;
};

// Outward unit normals by the differences of the neighbours. NaN where the pixel or a neighbour is
// none, and where there is no neighbour to either side.

/// A row of a plane's map: where its first pixel appears, from one to the next, and where the
/// camera stands (recon::Viewpoint). Metres.
struct FlatRow {
  float x = 0;
  float y = 0;
  float step = 0;
  float foot_x = 0;
  float foot_y = 0;
  float per_metre = 0;
};
/// Pointers to the start of a row.
struct RowPoints {
  float* x = nullptr;
  float* y = nullptr;
  float* z = nullptr;
  float* nx = nullptr;
  float* ny = nullptr;
  float* nz = nullptr;
};

/// Computes a flat surface: the true place, z = −depth, and the normal: with the slopes g of the
/// depth in places as they appear, (g_x, g_y, 1 − depth / height − (x − foot) · g / height),
/// normalised. `depth` is the start of the row.
void flat_points(const std::int16_t* depth, DepthUnit unit, const FlatRow& row, const RowPart& part,
                 const RowPoints& out) noexcept;

/// Computes normals of arbitrary points; y follows x by `apart` values, and z follows y. Also NaN
/// where the neighbours' differences are parallel.
void curved_normals(const float* x, std::size_t apart, const RowPart& part, float* nx, float* ny,
                    float* nz) noexcept;

}  // namespace dtact::perceive
