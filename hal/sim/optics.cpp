#include "hal/sim/optics.hpp"

#include <algorithm>
#include <cmath>

#include "hal/sim/truth.hpp"

namespace dtact::hal::sim {
namespace {

constexpr std::int32_t kOne = 1 << 15;
constexpr std::int32_t kHalf = kOne / 2;

int coarse_factor(const OpticsModel& optics, const Grid& grid) {
  // A quarter of the wide blur's width is fine enough to carry it.
  return std::clamp(static_cast<int>(optics.wide_mm / grid.spacing_mm / 4), 1, 8);
}

int divide_up(int a, int b) { return (a + b - 1) / b; }

// Width of the blur on the coarse grid. Averaging `factor` points and interpolating between coarse
// ones blur by themselves; what they do is taken off (variances add).
double wide_sigma(const OpticsModel& optics, const Grid& grid, int factor) {
  const double sigma = optics.wide_mm / grid.spacing_mm;
  const double f2 = factor * factor;
  const double own = factor == 1 ? 0 : (f2 - 1) / 12 + f2 / 6;
  return std::sqrt(std::max(sigma * sigma - own, 0.0)) / factor;
}

}  // namespace

double response(const OpticsModel& optics, double d_mm) noexcept {
  if (d_mm >= 0) return (optics.pressed_slope + optics.pressed_curve * d_mm) * d_mm;
  return (optics.bulged_slope + optics.bulged_curve * d_mm) * d_mm;
}

Optics::Blur::Blur(double sigma, int width, int height)
    : width_(width),
      height_(height),
      sums_(static_cast<std::size_t>(width)),
      between_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
  const int radius = static_cast<int>(std::ceil(3.5 * sigma));
  std::vector<double> weights;
  double sum = 0;
  for (int k = -radius; k <= radius; ++k) {
    weights.push_back(sigma > 0 ? std::exp(-0.5 * k * k / (sigma * sigma)) : 1);
    sum += weights.back();
  }
  std::int32_t rest = kOne - 1;  // 2^15 itself does not fit; the loss of 3e-5 is nothing
  for (const double weight : weights) {
    taps_.push_back(static_cast<std::int16_t>(std::lround(weight / sum * (kOne - 1))));
    rest -= taps_.back();
  }
  taps_[static_cast<std::size_t>(radius)] =
      static_cast<std::int16_t>(taps_[static_cast<std::size_t>(radius)] + rest);
  line_.resize(static_cast<std::size_t>(width + 2 * radius));
}

void Optics::Blur::run(std::span<const std::int16_t> in, std::span<std::int16_t> out) noexcept {
  const int radius = static_cast<int>(taps_.size()) / 2;
  const auto w = static_cast<std::size_t>(width_);
  const auto round_to = [&](std::int16_t* to) {
    for (std::size_t x = 0; x < w; ++x) to[x] = static_cast<std::int16_t>(sums_[x] >> 15);
  };
  for (int y = 0; y < height_; ++y) {
    const auto row = in.subspan(static_cast<std::size_t>(y) * w, w);
    std::fill_n(line_.begin(), radius, row.front());
    std::copy(row.begin(), row.end(), line_.begin() + radius);
    std::fill(line_.end() - radius, line_.end(), row.back());
    std::fill(sums_.begin(), sums_.end(), kHalf);
    for (std::size_t k = 0; k < taps_.size(); ++k) {
      const std::int32_t tap = taps_[k];
      const std::int16_t* const from = line_.data() + k;
      for (std::size_t x = 0; x < w; ++x) sums_[x] += tap * from[x];
    }
    round_to(between_.data() + static_cast<std::size_t>(y) * w);
  }
  for (int y = 0; y < height_; ++y) {
    std::fill(sums_.begin(), sums_.end(), kHalf);
    for (std::size_t k = 0; k < taps_.size(); ++k) {
      const int source = std::clamp(y + static_cast<int>(k) - radius, 0, height_ - 1);
      const std::int32_t tap = taps_[k];
      const std::int16_t* const from = between_.data() + static_cast<std::size_t>(source) * w;
      for (std::size_t x = 0; x < w; ++x) sums_[x] += tap * from[x];
    }
    round_to(out.data() + static_cast<std::size_t>(y) * w);
  }
}

Optics::Optics(const OpticsModel& optics, const Grid& grid)
    : width_(grid.width),
      height_(grid.height),
      factor_(coarse_factor(optics, grid)),
      coarse_width_(divide_up(grid.width, factor_)),
      coarse_height_(divide_up(grid.height, factor_)),
      narrow_weight_(static_cast<std::int32_t>(std::lround(optics.narrow_weight * kOne))),
      responses_(1U << 16U),
      narrow_(optics.narrow_mm / grid.spacing_mm, width_, height_),
      wide_(wide_sigma(optics, grid, factor_), coarse_width_, coarse_height_),
      sharp_(grid.size()),
      coarse_(static_cast<std::size_t>(coarse_width_) * static_cast<std::size_t>(coarse_height_)),
      coarse_blurred_(coarse_.size()) {
  for (int i = 0; i < 1 << 16; ++i) {
    const double share = response(optics, static_cast<double>(i - kOne) / Truth::kPerMm);
    // No more than everything can be lost, nor the light more than double.
    responses_[static_cast<std::size_t>(i)] =
        static_cast<std::int16_t>(std::lround(std::clamp(share, -0.9999, 0.9999) * kOne));
  }
}

void Optics::run(std::span<const std::int16_t> indentation, std::span<std::int16_t> loss) noexcept {
  for (std::size_t i = 0; i < sharp_.size(); ++i) {
    sharp_[i] = responses_[static_cast<std::size_t>(indentation[i] + kOne)];
  }
  narrow_.run(sharp_, loss);
  if (narrow_weight_ == kOne) return;
  shrink(sharp_);
  wide_.run(coarse_, coarse_blurred_);
  add_wide(loss);
}

void Optics::shrink(std::span<const std::int16_t> fine) noexcept {
  for (int cy = 0; cy < coarse_height_; ++cy) {
    const int y1 = std::min((cy + 1) * factor_, height_);
    for (int cx = 0; cx < coarse_width_; ++cx) {
      const int x1 = std::min((cx + 1) * factor_, width_);
      std::int32_t sum = 0;
      for (int y = cy * factor_; y < y1; ++y) {
        for (int x = cx * factor_; x < x1; ++x) {
          sum += fine[static_cast<std::size_t>(y * width_ + x)];
        }
      }
      const int count = (y1 - cy * factor_) * (x1 - cx * factor_);
      coarse_[static_cast<std::size_t>(cy * coarse_width_ + cx)] =
          static_cast<std::int16_t>(sum / count);
    }
  }
}

// loss = narrow·weight + wide·(1 − weight), the wide one interpolated between coarse centres.
void Optics::add_wide(std::span<std::int16_t> loss) const noexcept {
  const std::int32_t wide_weight = kOne - narrow_weight_;
  const int full = 2 * factor_;
  // The coarse point before fine point i and twice its distance from there, in fine points.
  const auto split = [&](int i, int count, int& index, int& weight) {
    const int twice = std::clamp(2 * i + 1 - factor_, 0, (count - 1) * full);
    index = std::min(twice / full, count - 2);
    weight = twice - index * full;
  };
  for (int y = 0; y < height_; ++y) {
    int cy = 0;
    int wy = 0;
    split(y, coarse_height_, cy, wy);
    const std::int16_t* const upper = coarse_blurred_.data() + cy * coarse_width_;
    const std::int16_t* const lower = upper + coarse_width_;
    for (int x = 0; x < width_; ++x) {
      int cx = 0;
      int wx = 0;
      split(x, coarse_width_, cx, wx);
      const std::int32_t top = upper[cx] * (full - wx) + upper[cx + 1] * wx;
      const std::int32_t bottom = lower[cx] * (full - wx) + lower[cx + 1] * wx;
      const std::int32_t wide = (top * (full - wy) + bottom * wy) / (full * full);
      std::int16_t& value = loss[static_cast<std::size_t>(y * width_ + x)];
      value =
          static_cast<std::int16_t>((value * narrow_weight_ + wide * wide_weight + kHalf) >> 15);
    }
  }
}

}  // namespace dtact::hal::sim
