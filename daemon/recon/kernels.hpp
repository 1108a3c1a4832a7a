#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "daemon/recon/depth_sums.hpp"
#include "daemon/recon/rectify.hpp"

/// The steps of a reconstruction, one row at a time. These scalar loops are the specification: any
/// other version of a kernel gives the same bits.
namespace dtact::recon::kernels {

/// Rows inside the reconstruction are written and read in whole blocks of this many pixels, so
/// only the first and the last kernel have a tail loop. (gcc unrolls loops of 16 before it can
/// vectorise them, but not loops of 32.)
inline constexpr int kBlock = 32;
/// Greatest radius of a smoothing kernel: pixels that must be readable on either side of a row.
inline constexpr int kMaxRadius = 32;
/// Taps are Q14 and sum to one over the whole symmetric kernel.
inline constexpr int kTapOne = 1 << 14;
/// Greatest magnitude that may be smoothed: the sum of two pixels fills int16. Differences are
/// within ±16320.
inline constexpr int kSmoothable = 16383;
/// Gain is Q12: 0 … 32767 means 0 … 7.9998.
inline constexpr int kGainOne = 1 << 12;

/// Pixels a row buffer needs for `width` pixels of image.
[[nodiscard]] constexpr int padded(int width) noexcept {
  return (width + kBlock - 1) / kBlock * kBlock;
}

/// Bilinear: four 8-bit pixels with weights of 1/128 × 1/128 give Q14, rounded to Q6 (0 … 16320).
/// Then reference − frame, so that darkening is positive (±16320).
void rectify_difference_row(const std::uint8_t* luma, std::ptrdiff_t stride,
                            const RectifyTable::Entry* entries, const std::int16_t* reference_q6,
                            int width, std::int16_t* difference_q6) noexcept;

/// The same reading for a reference of Q8 luma (0 … 65280), `frame_width` pixels a row, to Q6.
void rectify_reference_row(const std::uint16_t* luma_q8, std::ptrdiff_t frame_width,
                           const RectifyTable::Entry* entries, int width,
                           std::int16_t* reference_q6) noexcept;

/// Area means for a coarse map, whose pixels are decimation × decimation (2 or 4) of the table's:
/// their Q14 readings are added up and rounded once. `entries`: of the first of the row's
/// `decimation` rows, `fine_width` entries each; difference = reference − mean.
void rectify_mean_difference_row(const std::uint8_t* luma, std::ptrdiff_t stride,
                                 const RectifyTable::Entry* entries, std::ptrdiff_t fine_width,
                                 int decimation, const std::int16_t* reference_q6, int width,
                                 std::int16_t* difference_q6) noexcept;

/// The mean of a reference: `fine` is `decimation` rows (1, 2 or 4) of width · decimation values of
/// rectify_reference_row, rounded half up. Each of them was rounded to Q6 before.
void average_reference_row(const std::int16_t* const* fine, int decimation, int width,
                           std::int16_t* reference_q6) noexcept;

/// out[x] = Σ taps[k] · (row[x − k] + row[x + k]) in 32 bits, rounded half up. `taps`: Q14 from the
/// centre outwards. Reads `taps.size() − 1` values before `row` and after `padded_width`; writes
/// `padded_width` values, a multiple of kBlock. Inputs within ±kSmoothable.
void smooth_horizontal_row(const std::int16_t* row, std::span<const std::int16_t> taps,
                           int padded_width, std::int16_t* out) noexcept;

/// The same down the columns: `rows` points at 2·radius + 1 rows, the centre in the middle.
void smooth_vertical_row(const std::int16_t* const* rows, std::span<const std::int16_t> taps,
                         int padded_width, std::int16_t* out) noexcept;

/// A LUT that is straight between knots 2^step_bits entries apart: what between() says it is.
struct alignas(64) Knots {
  static constexpr std::size_t kCount = 128;  ///< capacity of four 512-bit registers
  static constexpr int kFraction = 3;         ///< Heights are in eighths of a micrometre, …
  static constexpr int kDeepestUm = 4000;     ///< … so that this is the greatest one.

  std::array<std::int16_t, kCount> at_q3{};
  std::array<std::int16_t, kCount> rise_q3{};  ///< From each knot to the next.
  int step_bits = 6;                           ///< 6 or 7: a knot each grey level, or every other.

  [[nodiscard]] constexpr std::size_t step() const noexcept { return std::size_t{1} << step_bits; }
};

/// Micrometres at entry `place`, 0 … (kCount − 1) · step(): the rise rounded half up to an eighth,
/// then the sum to whole ones.
[[nodiscard]] std::int16_t between(const Knots& knots, int place) noexcept;

/// A LUT in the shape the look-up wants.
struct LutView {
  const std::int16_t* um = nullptr;  ///< um[0] belongs to first_q6.
  int first_q6 = 0;
  int last_q6 = 0;     ///< Index of the last entry, which stands for everything darker.
  int covered_q6 = 0;  ///< A darkening above this is beyond the calibration.
  /// Not null: um[i] is between(*knots, i) up to covered_q6, and kUntrusted above it.
  const Knots* knots = nullptr;
};

/// Gain (32-bit product, rounded half up, saturated to int16), LUT, untrusted mark. `gain_q12`
/// null: one. `untrusted` null: no mark. Returns how many pixels were beyond the calibration.
int gain_lut_mask_row(const std::int16_t* difference_q6, const std::int16_t* gain_q12,
                      const std::uint8_t* untrusted, const LutView& lut, int width,
                      std::int16_t* depth_um) noexcept;

/// Marks untrusted pixels in a row of depth.
void mask_row(const std::uint8_t* untrusted, int width, std::int16_t* depth_um) noexcept;

/// Adds the pixels [x0, x1) of row `y` of a depth map, which begins at `row_um`, to everything but
/// the bend. In any order of pixels.
void sum_row(const std::int16_t* row_um, int y, int x0, int x1, DepthSums& sums) noexcept;

/// Adds the pixels [x0, x1) of a row of a depth map, whose rows are `stride` values apart, to the
/// bend. All pixels rules.bend_reach away in four directions can be read.
void bend_row(const std::int16_t* row_um, std::ptrdiff_t stride, int x0, int x1,
              DepthSums& sums) noexcept;

/// gain = calibration / now in Q12, rounded. Where either is darker than kDarkest_q6 or the
/// quotient exceeds the Q12 range, the gain is one and the pixel is marked in `untrusted`, which
/// collects marks by OR.
void gain_row(const std::int16_t* calibration_q6, const std::int16_t* now_q6, int width,
              std::int16_t* gain_q12, std::uint8_t* untrusted) noexcept;

/// out = row × factor, rounded half up, saturated to int16: a reference under light that has
/// changed by a factor, or a gain under its reciprocal. `factor_q15`: 0 … 65535, kFactorOne is one;
/// row ≥ 0.
void scale_row(const std::int16_t* row, std::int32_t factor_q15, int width,
               std::int16_t* out) noexcept;
inline constexpr std::int32_t kFactorOne = 1 << 15;

/// Eight grey levels. The response scales with the light: where an pixel without contact at 160
/// levels darkens by 31 levels a millimetre, one at 8 darkens by less than two, which is noise.
inline constexpr int kDarkest_q6 = 8 * 64;

}  // namespace dtact::recon::kernels
