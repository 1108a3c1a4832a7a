#include "daemon/recon/kernels.hpp"

#include <algorithm>
#include <cstdlib>

#include "daemon/recon/model.hpp"

namespace dtact::recon::kernels {
namespace {

/// The four source pixels weighted, Q14 above the pixel's own format.
template <typename Pixel>
std::int32_t bilinear(const Pixel* p, std::ptrdiff_t stride, RectifyTable::Entry e) noexcept {
  const Pixel* q = p + stride;
  const std::int32_t upper = p[0] * (128 - e.fx) + p[1] * e.fx;
  const std::int32_t lower = q[0] * (128 - e.fx) + q[1] * e.fx;
  return upper * (128 - e.fy) + lower * e.fy;
}

/// Half a unit of the last place, then the shift: rounds half up, also below zero.
template <int kBits>
std::int32_t round_shift(std::int32_t value) noexcept {
  return (value + (1 << (kBits - 1))) >> kBits;
}

/// The sum of the two pixels that share a tap. Within kSmoothable it is an int16, so a product is
/// 16 × 16 → 32 bits, which every vector unit has; 32 × 32 is missing in SSE2.
std::int16_t pair_sum(std::int16_t a, std::int16_t b) noexcept {
  return static_cast<std::int16_t>(a + b);
}

int saturate(int value) noexcept { return std::clamp(value, INT16_MIN, INT16_MAX); }

}  // namespace

void rectify_mean_difference_row(const std::uint8_t* luma, std::ptrdiff_t stride,
                                 const RectifyTable::Entry* entries, std::ptrdiff_t fine_width,
                                 int decimation, const std::int16_t* reference_q6, int width,
                                 std::int16_t* difference_q6) noexcept {
  for (int x = 0; x < width; ++x) {
    std::int32_t q14 = 0;
    for (int k = 0; k < decimation; ++k) {
      const RectifyTable::Entry* const fine =
          entries + k * fine_width + std::ptrdiff_t{x} * decimation;
      for (int i = 0; i < decimation; ++i) {
        q14 += bilinear(luma + fine[i].y * stride + fine[i].x, stride, fine[i]);
      }
    }
    const std::int32_t mean_q6 = decimation == 2 ? round_shift<10>(q14) : round_shift<12>(q14);
    difference_q6[x] = static_cast<std::int16_t>(reference_q6[x] - mean_q6);
  }
}

void average_reference_row(const std::int16_t* const* fine, int decimation, int width,
                           std::int16_t* reference_q6) noexcept {
  const int pixels = decimation * decimation;
  for (int x = 0; x < width; ++x) {
    std::int32_t sum = 0;
    for (int k = 0; k < decimation; ++k) {
      for (int i = 0; i < decimation; ++i) sum += fine[k][x * decimation + i];
    }
    // Luma is not negative: half up.
    reference_q6[x] = static_cast<std::int16_t>((sum + pixels / 2) / pixels);
  }
}

void rectify_difference_row(const std::uint8_t* luma, std::ptrdiff_t stride,
                            const RectifyTable::Entry* entries, const std::int16_t* reference_q6,
                            int width, std::int16_t* difference_q6) noexcept {
  for (int x = 0; x < width; ++x) {
    const RectifyTable::Entry e = entries[x];
    const std::int32_t q14 = bilinear(luma + e.y * stride + e.x, stride, e);
    difference_q6[x] = static_cast<std::int16_t>(reference_q6[x] - round_shift<8>(q14));
  }
}

void rectify_reference_row(const std::uint16_t* luma_q8, std::ptrdiff_t frame_width,
                           const RectifyTable::Entry* entries, int width,
                           std::int16_t* reference_q6) noexcept {
  for (int x = 0; x < width; ++x) {
    const RectifyTable::Entry e = entries[x];
    const std::int32_t q22 = bilinear(luma_q8 + e.y * frame_width + e.x, frame_width, e);
    reference_q6[x] = static_cast<std::int16_t>(round_shift<16>(q22));
  }
}

void smooth_horizontal_row(const std::int16_t* row, std::span<const std::int16_t> taps,
                           int padded_width, std::int16_t* out) noexcept {
  const int radius = static_cast<int>(taps.size()) - 1;
  for (int x = 0; x < padded_width; x += kBlock) {
    const std::int16_t* centre = row + x;
    std::int32_t sum[kBlock];
    for (int i = 0; i < kBlock; ++i) sum[i] = taps[0] * centre[i];
    for (int k = 1; k <= radius; ++k) {
      const std::int16_t tap = taps[static_cast<std::size_t>(k)];
      for (int i = 0; i < kBlock; ++i) sum[i] += tap * pair_sum(centre[i - k], centre[i + k]);
    }
    for (int i = 0; i < kBlock; ++i)
      out[x + i] = static_cast<std::int16_t>(round_shift<14>(sum[i]));
  }
}

void smooth_vertical_row(const std::int16_t* const* rows, std::span<const std::int16_t> taps,
                         int padded_width, std::int16_t* out) noexcept {
  const int radius = static_cast<int>(taps.size()) - 1;
  for (int x = 0; x < padded_width; x += kBlock) {
    const std::int16_t* centre = rows[radius] + x;
    std::int32_t sum[kBlock];
    for (int i = 0; i < kBlock; ++i) sum[i] = taps[0] * centre[i];
    for (int k = 1; k <= radius; ++k) {
      const std::int16_t tap = taps[static_cast<std::size_t>(k)];
      const std::int16_t* above = rows[radius - k] + x;
      const std::int16_t* below = rows[radius + k] + x;
      for (int i = 0; i < kBlock; ++i) sum[i] += tap * pair_sum(above[i], below[i]);
    }
    for (int i = 0; i < kBlock; ++i)
      out[x + i] = static_cast<std::int16_t>(round_shift<14>(sum[i]));
  }
}

std::int16_t between(const Knots& knots, int place) noexcept {
  const int bits = knots.step_bits;
  const auto k = static_cast<std::size_t>(place >> bits);
  const int inside = place & ((1 << bits) - 1);
  const std::int32_t rise_q3 = (knots.rise_q3[k] * inside + (1 << (bits - 1))) >> bits;
  return static_cast<std::int16_t>(round_shift<Knots::kFraction>(knots.at_q3[k] + rise_q3));
}

int gain_lut_mask_row(const std::int16_t* difference_q6, const std::int16_t* gain_q12,
                      const std::uint8_t* untrusted, const LutView& lut, int width,
                      std::int16_t* depth_um) noexcept {
  int beyond = 0;
  for (int x = 0; x < width; ++x) {
    const std::int32_t gain = gain_q12 == nullptr ? kGainOne : gain_q12[x];
    const std::int32_t lit = std::clamp(round_shift<12>(difference_q6[x] * gain), -32768, 32767);
    const bool trusted = untrusted == nullptr || untrusted[x] == 0;
    beyond += static_cast<int>(trusted && lit > lut.covered_q6);
    const std::int16_t um = lut.um[std::clamp(lit, lut.first_q6, lut.last_q6) - lut.first_q6];
    depth_um[x] = trusted ? um : kUntrusted;
  }
  return beyond;
}

void mask_row(const std::uint8_t* untrusted, int width, std::int16_t* depth_um) noexcept {
  for (int x = 0; x < width; ++x) {
    if (untrusted[x] != 0) depth_um[x] = kUntrusted;
  }
}

void sum_row(const std::int16_t* row_um, int y, int x0, int x1, DepthSums& sums) noexcept {
  for (int x = x0; x < x1; ++x) {
    const std::int16_t um = row_um[x];
    if (um == kUntrusted) continue;
    if (um > sums.rules.release_um) ++sums.lost;
    if (um > sums.rules.threshold_um) {
      ++sums.made;
      sums.um += um;
      sums.um_x += std::int64_t{um} * x;
      sums.um_y += std::int64_t{um} * y;
      if (y % 2 == 0) {
        // Of twice the depth, as an int16 in Q15, which vectors multiply by themselves.
        const std::int64_t square = (4 * std::int64_t{um} * um + (1 << 14)) >> 15;
        sums.square += square;
        sums.square_x += square * x;
        sums.square_y += square * y;
      }
    }
    const bool earlier = y < sums.deepest_y || (y == sums.deepest_y && x < sums.deepest_x);
    if (um > sums.deepest_um || (um == sums.deepest_um && earlier)) {
      sums.deepest_um = um;
      sums.deepest_x = x;
      sums.deepest_y = y;
    }
  }
}

void bend_row(const std::int16_t* row_um, std::ptrdiff_t stride, int x0, int x1,
              DepthSums& sums) noexcept {
  const int reach = sums.rules.bend_reach;
  const std::ptrdiff_t below = reach * stride;
  for (int x = x0; x < x1; ++x) {
    const std::int16_t* const at = row_um + x;
    if (*at <= sums.rules.bend_from_um) continue;
    if (std::min({at[-reach], at[reach], at[-below], at[below]}) == kUntrusted) continue;
    ++sums.bent;
    const int across = saturate(at[-reach] - *at + at[reach] - *at);
    const int along = saturate(at[-below] - *at + at[below] - *at);
    sums.bend_um += std::min(std::abs(saturate(across + along)), INT16_MAX);
  }
}

void gain_row(const std::int16_t* calibration_q6, const std::int16_t* now_q6, int width,
              std::int16_t* gain_q12, std::uint8_t* untrusted) noexcept {
  for (int x = 0; x < width; ++x) {
    const std::int32_t was = calibration_q6[x];
    const std::int32_t now = now_q6[x];
    const bool dark = was < kDarkest_q6 || now < kDarkest_q6;
    const std::int32_t gain = dark ? kGainOne : (was * kGainOne + now / 2) / now;
    const bool usable = !dark && gain <= INT16_MAX;
    gain_q12[x] = static_cast<std::int16_t>(usable ? gain : kGainOne);
    untrusted[x] = static_cast<std::uint8_t>(untrusted[x] | (usable ? 0 : 0xFF));
  }
}

void scale_row(const std::int16_t* row, std::int32_t factor_q15, int width,
               std::int16_t* out) noexcept {
  // What it changes by: a 16 × 16 → 32 bit product, which every vector unit has.
  const auto change = static_cast<std::int16_t>(factor_q15 - kFactorOne);
  for (int x = 0; x < width; ++x) {
    const std::int32_t scaled = row[x] + round_shift<15>(row[x] * change);
    out[x] = static_cast<std::int16_t>(scaled < INT16_MAX ? scaled : INT16_MAX);
  }
}

}  // namespace dtact::recon::kernels
