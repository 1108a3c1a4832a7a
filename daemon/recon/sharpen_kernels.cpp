#include "daemon/recon/sharpen_kernels.hpp"

#include <algorithm>

#include "daemon/recon/kernels.hpp"

namespace dtact::recon::kernels {
namespace {

std::int16_t clamped(int level_q6) noexcept {
  return static_cast<std::int16_t>(std::clamp(level_q6, -kSmoothable, kSmoothable));
}

/// a · b in Q15, rounded half up.
std::int32_t product_q15(std::int32_t a, std::int32_t b) noexcept {
  return (a * b + (1 << 14)) >> 15;
}

std::int32_t between(std::int32_t from, std::int32_t to, std::int32_t share_q15) noexcept {
  return from + product_q15(to - from, share_q15);
}

}  // namespace

void lit_row(const std::int16_t* difference_q6, const std::int16_t* gain_q12, int width,
             std::int16_t* level_q6) noexcept {
  for (int x = 0; x < width; ++x) {
    const std::int32_t gain = gain_q12[x] == 0 ? kGainOne : gain_q12[x];
    level_q6[x] = clamped((difference_q6[x] * gain + (1 << 11)) >> 12);
  }
}

void shrink_row(const std::int16_t* const* rows, int coarse_width, std::int16_t* coarse) noexcept {
  constexpr int kPixels = kCoarse * kCoarse;
  for (int k = 0; k < coarse_width; ++k) {
    std::int32_t sum = kPixels / 2;
    for (int i = 0; i < kCoarse; ++i) {
      for (int x = kCoarse * k; x < kCoarse * (k + 1); ++x) sum += rows[i][x];
    }
    coarse[k] = static_cast<std::int16_t>(sum >> 4);
  }
}

void sharpen_row(const std::int16_t* level, const std::int16_t* before, const std::int16_t* narrow,
                 const WideRows& wide, std::int16_t wide_share_q15, int width,
                 std::int16_t* after) noexcept {
  const auto down = [&wide](int k) { return between(wide.near[k], wide.other[k], wide.other_q15); };
  for (int x = 0; x < width; ++x) {
    // Pixels are at 1/8, 3/8, 5/8 and 7/8 of a coarse one, whose value is that of its middle.
    const int k = x / kCoarse;
    const int in = x % kCoarse;
    const std::int32_t share = in == 0 || in == kCoarse - 1 ? 3 * kEighth : kEighth;
    const std::int32_t mean = between(down(k), down(in < kCoarse / 2 ? k - 1 : k + 1), share);
    const std::int32_t scattered = between(narrow[x], mean, wide_share_q15);
    after[x] = clamped(before[x] + level[x] - scattered);
  }
}

}  // namespace dtact::recon::kernels
