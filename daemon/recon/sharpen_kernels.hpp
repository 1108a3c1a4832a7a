#pragma once

#include <cstdint>

/// The steps of Van Cittert's filter, one row at a time: scalar loops that are the specification,
/// as in kernels.hpp. Levels are darkening in Q6 within ±kernels::kSmoothable, so that differences
/// of two fill int16 and no more.
namespace dtact::recon::kernels {

/// The wide part of the scattering is taken from a grid this many times coarser.
inline constexpr int kCoarse = 4;

/// The level that is sharpened: the difference under its gain (32-bit product, rounded half up),
/// clamped. Where the gain is 0, an untrusted pixel, as if it were one: it is marked after the
/// LUT, and its neighbours are best served by what stands there.
void lit_row(const std::int16_t* difference_q6, const std::int16_t* gain_q12, int width,
             std::int16_t* level_q6) noexcept;

/// Means of kCoarse × kCoarse levels, rounded half up. `rows`: kCoarse rows of kCoarse ·
/// coarse_width levels.
void shrink_row(const std::int16_t* const* rows, int coarse_width, std::int16_t* coarse) noexcept;

/// Position of a row between two of the coarse grid. Their values are read from one before the
/// first to one after the last that is needed.
struct WideRows {
  const std::int16_t* near = nullptr;   ///< The coarse row that the row lies in.
  const std::int16_t* other = nullptr;  ///< Its neighbour, above or below.
  std::int16_t other_q15 = 0;           ///< The neighbour's share, kEighth or 3 · kEighth.
};
inline constexpr std::int16_t kEighth = 1 << 12;  ///< Q15

/// One step for a row: after = before + level − H·before, clamped to ±kSmoothable. H·before
/// is narrow + share · (wide − narrow), and `wide` is read bilinearly, down the columns first.
/// Products are 16 × 16 bits in Q15, rounded half up. `after` may be `before`.
void sharpen_row(const std::int16_t* level, const std::int16_t* before, const std::int16_t* narrow,
                 const WideRows& wide, std::int16_t wide_share_q15, int width,
                 std::int16_t* after) noexcept;

}  // namespace dtact::recon::kernels
