#pragma once

#include <cstddef>
#include <cstdint>

namespace dtact::perceive {

// The loops over a row's pixels, for every instruction set that Highway knows; the fastest one at
// run time.

/// value · scale, NaN for `untrusted`.
void to_metres(const std::int16_t* values, std::size_t count, int untrusted, float scale,
               float* out) noexcept;

/// How many of them are NaN.
[[nodiscard]] int count_holes(const float* values, int count) noexcept;

/// point − depth · normal.
void press(const float* point, const float* normal, const float* depth, int count,
           float* out) noexcept;

// Outward unit normals of `count` pixels by the differences of their neighbours, which lie so many
// values away.

/// Of a flat surface: z = −depth, so that it is (d depth/dx, d depth/dy, 1), normalised. NaN where
/// the pixel or a neighbour is.
void flat_normals(const float* depth, std::ptrdiff_t left, std::ptrdiff_t right,
                  std::ptrdiff_t above, std::ptrdiff_t below, int count, float per_column,
                  float per_row, float* nx, float* ny, float* nz) noexcept;

/// Of points anywhere, whose y lie `size` values after their x, and z after y. NaN too where the
/// neighbours' differences are parallel.
void curved_normals(const float* x, std::size_t size, std::ptrdiff_t left, std::ptrdiff_t right,
                    std::ptrdiff_t above, std::ptrdiff_t below, int count, float* nx, float* ny,
                    float* nz) noexcept;

}  // namespace dtact::perceive
