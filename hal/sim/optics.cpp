#include "hal/sim/optics.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "hal/sim/truth.hpp"

namespace dtact::hal::sim {
namespace {

constexpr std::int32_t kOne = 1 << 15;
constexpr std::int32_t kHalf = kOne / 2;
constexpr std::int32_t kShareOne = 1 << 12;
constexpr double kThinnest = 0.2;  // of the mean thickness, beyond the field of a tapered gel

// Shares of the thickness that widths are kept for, where they follow it; in between, two are
// mixed. Nothing bulges or is pressed beyond the outer ones.
constexpr std::array<double, 4> kThicknesses = {1.25, 1.0, 0.6, 0.1};

// How much of the light that is lost at this thickness is scattered by the widths of
// kThicknesses[part].
double share_of(std::size_t part, double thickness) {
  const double t = std::clamp(thickness, kThicknesses.back(), kThicknesses.front());
  const double here = kThicknesses[part];
  if (t >= here)
    return part == 0
               ? 1
               : std::max(0.0, (kThicknesses[part - 1] - t) / (kThicknesses[part - 1] - here));
  return std::max(0.0, (t - kThicknesses[part + 1]) / (here - kThicknesses[part + 1]));
}

// How many times as wide the scattering is there.
double growth_at(const OpticsModel& optics, double thickness) {
  return 1 + optics.growth * (thickness - 1);
}

std::size_t coarse_factor(const OpticsModel& optics, const Grid& grid) {
  // A quarter of the wide blur's width is fine enough to carry it.
  const double least = growth_at(optics, kThicknesses.back()) * optics.wide_mm;
  return std::clamp<std::size_t>(static_cast<std::size_t>(least / grid.spacing_mm / 4), 1, 8);
}

std::size_t divide_up(std::size_t a, std::size_t b) { return (a + b - 1) / b; }

// Width of the blur on the coarse grid. Averaging `factor` points and interpolating between coarse
// ones blur by themselves; what they do is taken off (variances add).
double coarse_sigma(double sigma_mm, const Grid& grid, std::size_t count) {
  const auto factor = static_cast<double>(count);
  const double sigma = sigma_mm / grid.spacing_mm;
  const double f2 = factor * factor;
  const double own = factor == 1 ? 0 : (f2 - 1) / 12 + f2 / 6;
  return std::sqrt(std::max(sigma * sigma - own, 0.0)) / factor;
}

std::vector<std::uint16_t> thickness_shares(const GelModel& gel, const Grid& grid) {
  std::vector<std::uint16_t> shares;
  if (gel.taper_x == 0 && gel.taper_y == 0) return shares;
  shares.reserve(grid.size());
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const double x = grid.x0_mm + column * grid.spacing_mm;
      const double y = grid.y0_mm + row * grid.spacing_mm;
      const double thickness = std::max(kThinnest, 1 + gel.taper_x * x + gel.taper_y * y);
      shares.push_back(static_cast<std::uint16_t>(std::lround(kShareOne / thickness)));
    }
  }
  return shares;
}

// The integral from 0 to x of a slope that is linear between knots and constant beyond them.
double integral(std::span<const double> knots, std::span<const double> slopes, double x) {
  const auto slope = [&](double at) {
    const auto next = static_cast<std::size_t>(std::ranges::upper_bound(knots, at) - knots.begin());
    if (next == 0) return slopes.front();
    if (next == knots.size()) return slopes.back();
    return std::lerp(slopes[next - 1], slopes[next],
                     (at - knots[next - 1]) / (knots[next] - knots[next - 1]));
  };
  double sum = 0;
  double from = std::min(x, 0.0);
  const double to = std::max(x, 0.0);
  while (from < to) {
    const auto next = std::ranges::upper_bound(knots, from);
    const double end = next == knots.end() ? to : std::min(*next, to);
    sum += (slope(from) + slope(end)) / 2 * (end - from);
    from = end;
  }
  return x < 0 ? -sum : sum;
}

}  // namespace

double response(const OpticsModel& optics, double d_mm, double thickness_mm) noexcept {
  if (!optics.knots.empty()) return integral(optics.knots, optics.slopes, d_mm / thickness_mm);
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

Optics::Optics(const OpticsModel& optics, const Grid& grid, const GelModel& gel)
    : width_(static_cast<std::size_t>(grid.width)),
      height_(static_cast<std::size_t>(grid.height)),
      factor_(coarse_factor(optics, grid)),
      coarse_width_(divide_up(width_, factor_)),
      coarse_height_(divide_up(height_, factor_)),
      narrow_weight_(static_cast<std::int32_t>(std::lround(optics.narrow_weight * kOne))),
      far_weight_(optics.far_weight > 0
                      ? static_cast<std::int32_t>(
                            std::lround(optics.far_weight / (1 - optics.narrow_weight) * kOne))
                      : 0),
      shares_(thickness_shares(gel, grid)),
      sharp_(grid.size()),
      one_(optics.growth > 0 ? grid.size() : 0),
      coarse_(coarse_width_ * coarse_height_),
      coarse_blurred_(coarse_.size()),
      coarse_far_(far_weight_ > 0 ? coarse_.size() : 0) {
  const std::size_t parts = optics.growth > 0 ? kThicknesses.size() : 1;
  for (std::size_t part = 0; part < parts; ++part) {
    const double scale = parts > 1 ? growth_at(optics, kThicknesses[part]) : 1;
    const auto coarse = [&](double sigma_mm) {
      return Blur(coarse_sigma(scale * sigma_mm, grid, factor_), coarse_width_, coarse_height_);
    };
    parts_.push_back({std::vector<std::int16_t>(1U << 16U),
                      Blur(scale * optics.narrow_mm / grid.spacing_mm, width_, height_),
                      coarse(optics.wide_mm), coarse(optics.far_mm)});
    for (int i = 0; i < 1 << 16; ++i) {
      const double d_mm = static_cast<double>(i - kOne) / Truth::kPerMm;
      const double share = response(optics, d_mm, gel.thickness_mm);
      const double of_part = parts > 1 ? share_of(part, 1 - d_mm / gel.thickness_mm) : 1;
      // No more than everything can be lost, nor the light more than double.
      parts_.back().responses[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(
          std::lround(of_part * std::clamp(share, -0.9999, 0.9999) * kOne));
    }
  }
}

void Optics::run(std::span<const std::int16_t> indentation, std::span<std::int16_t> loss) noexcept {
  scatter(parts_.front(), indentation, loss);
  for (std::size_t part = 1; part < parts_.size(); ++part) {
    scatter(parts_[part], indentation, one_);
    for (std::size_t i = 0; i < one_.size(); ++i) {
      loss[i] = static_cast<std::int16_t>(std::clamp(loss[i] + one_[i], -kOne, kOne - 1));
    }
  }
}

void Optics::scatter(Part& part, std::span<const std::int16_t> indentation,
                     std::span<std::int16_t> loss) noexcept {
  for (std::size_t i = 0; i < sharp_.size(); ++i) {
    std::int32_t d = indentation[i];
    if (!shares_.empty()) d = std::clamp((d * shares_[i]) / kShareOne, -kOne, kOne - 1);
    sharp_[i] = part.responses[static_cast<std::uint32_t>(d + kOne)];
  }
  part.narrow.run(sharp_, loss);
  if (narrow_weight_ == kOne) return;
  shrink(sharp_);
  part.wide.run(coarse_, coarse_blurred_);
  if (far_weight_ > 0) {
    part.far.run(coarse_, coarse_far_);
    for (std::size_t i = 0; i < coarse_.size(); ++i) {
      coarse_blurred_[i] = static_cast<std::int16_t>(
          (coarse_blurred_[i] * (kOne - far_weight_) + coarse_far_[i] * far_weight_ + kHalf) >> 15);
    }
  }
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
