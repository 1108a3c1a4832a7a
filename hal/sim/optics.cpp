#include "hal/sim/optics.hpp"

#include <algorithm>
#include <cmath>

#include "hal/sim/truth.hpp"

namespace dtact::hal::sim {
namespace {

constexpr std::int32_t kOne = 1 << 15;
constexpr std::int32_t kHalf = kOne / 2;
constexpr std::int32_t kShareOne = 1 << 12;
constexpr double kThinnest = 0.2;  // of the mean thickness, beyond the field of a tapered layer

std::size_t coarse_factor(const OpticsModel& optics, const Grid& grid) {
  // A quarter of the wide blur's width is fine enough to carry it.
  return std::clamp<std::size_t>(static_cast<std::size_t>(optics.wide_mm / grid.spacing_mm / 4), 1,
                                 8);
}

std::size_t divide_up(std::size_t a, std::size_t b) { return (a + b - 1) / b; }

// Width of the blur on the coarse grid. Averaging `factor` points and interpolating between coarse
// ones blur by themselves; what they do is taken off (variances add).
double wide_sigma(const OpticsModel& optics, const Grid& grid, std::size_t count) {
  const auto factor = static_cast<double>(count);
  const double sigma = optics.wide_mm / grid.spacing_mm;
  const double f2 = factor * factor;
  const double own = factor == 1 ? 0 : (f2 - 1) / 12 + f2 / 6;
  return std::sqrt(std::max(sigma * sigma - own, 0.0)) / factor;
}

std::vector<std::uint16_t> thickness_shares(const LayerModel& layer, const Grid& grid) {
  std::vector<std::uint16_t> shares;
  if (layer.taper_x == 0 && layer.taper_y == 0) return shares;
  shares.reserve(grid.size());
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const double x = grid.x0_mm + column * grid.spacing_mm;
      const double y = grid.y0_mm + row * grid.spacing_mm;
      const double thickness = std::max(kThinnest, 1 + layer.taper_x * x + layer.taper_y * y);
      shares.push_back(static_cast<std::uint16_t>(std::lround(kShareOne / thickness)));
    }
  }
  return shares;
}

}  // namespace

double response(const OpticsModel& optics, double d_mm) noexcept {
  if (d_mm >= 0) return (optics.pressed_slope + optics.pressed_curve * d_mm) * d_mm;
  return (optics.bulged_slope + optics.bulged_curve * d_mm) * d_mm;
}

Optics::Blur::Blur(double sigma, std::size_t width, std::size_t height)
    : width_(width), height_(static_cast<int>(height)), sums_(width), between_(width * height) {
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
  line_.resize(width + 2 * static_cast<std::size_t>(radius));
}

void Optics::Blur::run(std::span<const std::int16_t> in, std::span<std::int16_t> out) noexcept {
  const int radius = static_cast<int>(taps_.size()) / 2;
  const std::size_t w = width_;
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

Optics::Optics(const OpticsModel& optics, const Grid& grid, const LayerModel& layer)
    : width_(static_cast<std::size_t>(grid.width)),
      height_(static_cast<std::size_t>(grid.height)),
      factor_(coarse_factor(optics, grid)),
      coarse_width_(divide_up(width_, factor_)),
      coarse_height_(divide_up(height_, factor_)),
      narrow_weight_(static_cast<std::int32_t>(std::lround(optics.narrow_weight * kOne))),
      responses_(1U << 16U),
      shares_(thickness_shares(layer, grid)),
      narrow_(optics.narrow_mm / grid.spacing_mm, width_, height_),
      wide_(wide_sigma(optics, grid, factor_), coarse_width_, coarse_height_),
      sharp_(grid.size()),
      coarse_(coarse_width_ * coarse_height_),
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
    std::int32_t d = indentation[i];
    if (!shares_.empty()) d = std::clamp((d * shares_[i]) / kShareOne, -kOne, kOne - 1);
    sharp_[i] = responses_[static_cast<std::uint32_t>(d + kOne)];
  }
  narrow_.run(sharp_, loss);
  if (narrow_weight_ == kOne) return;
  shrink(sharp_);
  wide_.run(coarse_, coarse_blurred_);
  add_wide(loss);
}

void Optics::shrink(std::span<const std::int16_t> fine) noexcept {
  for (std::size_t cy = 0; cy < coarse_height_; ++cy) {
    const std::size_t y0 = cy * factor_;
    const std::size_t y1 = std::min(y0 + factor_, height_);
    for (std::size_t cx = 0; cx < coarse_width_; ++cx) {
      const std::size_t x0 = cx * factor_;
      const std::size_t x1 = std::min(x0 + factor_, width_);
      std::int32_t sum = 0;
      for (std::size_t y = y0; y < y1; ++y) {
        for (std::size_t x = x0; x < x1; ++x) sum += fine[y * width_ + x];
      }
      const auto count = std::max(static_cast<std::int32_t>((y1 - y0) * (x1 - x0)), 1);
      coarse_[cy * coarse_width_ + cx] = static_cast<std::int16_t>(sum / count);
    }
  }
}

// loss = narrow·weight + wide·(1 − weight), the wide one interpolated between coarse centres.
void Optics::add_wide(std::span<std::int16_t> loss) const noexcept {
  const std::int32_t wide_weight = kOne - narrow_weight_;
  const auto full = static_cast<std::int32_t>(2 * factor_);
  struct Split {
    std::size_t index;    // of the coarse point before the fine one
    std::int32_t weight;  // twice the distance from there, in fine points
  };
  const auto split = [&](std::size_t i, std::size_t count) {
    const std::size_t from_first = std::max(2 * i + 1, factor_) - factor_;
    const std::size_t twice = std::min(from_first, (count - 1) * 2 * factor_);
    const std::size_t index = std::min(twice / (2 * factor_), count - 2);
    return Split{index, static_cast<std::int32_t>(twice - index * 2 * factor_)};
  };
  for (std::size_t y = 0; y < height_; ++y) {
    const Split at_y = split(y, coarse_height_);
    const std::int16_t* const upper = coarse_blurred_.data() + at_y.index * coarse_width_;
    const std::int16_t* const lower = upper + coarse_width_;
    for (std::size_t x = 0; x < width_; ++x) {
      const auto [cx, wx] = split(x, coarse_width_);
      const std::int32_t top = upper[cx] * (full - wx) + upper[cx + 1] * wx;
      const std::int32_t bottom = lower[cx] * (full - wx) + lower[cx + 1] * wx;
      const std::int32_t wide = (top * (full - at_y.weight) + bottom * at_y.weight) / (full * full);
      std::int16_t& value = loss[y * width_ + x];
      value =
          static_cast<std::int16_t>((value * narrow_weight_ + wide * wide_weight + kHalf) >> 15);
    }
  }
}

}  // namespace dtact::hal::sim
