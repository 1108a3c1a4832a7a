#include "tests/accuracy/chart/sharpen.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "daemon/recon/model.hpp"

namespace dtact::chart {
namespace {

std::size_t index(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

/// A symmetric filter along a row, the edge repeated.
void filter_row(const float* in, float* out, int count, const std::vector<float>& taps) {
  const auto reach = static_cast<int>(taps.size()) - 1;
  const auto at_edge = [&](int i) {
    float sum = taps[0] * in[i];
    for (int k = 1; k <= reach; ++k) {
      sum += taps[static_cast<std::size_t>(k)] *
             (in[std::max(0, i - k)] + in[std::min(count - 1, i + k)]);
    }
    out[i] = sum;
  };
  const int inner = std::max(reach, count - reach);
  for (int i = 0; i < std::min(reach, count); ++i) at_edge(i);
  for (int i = inner; i < count; ++i) at_edge(i);
  for (int i = reach; i < inner; ++i) out[i] = taps[0] * in[i];
  for (int k = 1; k <= reach; ++k) {
    const float tap = taps[static_cast<std::size_t>(k)];
    for (int i = reach; i < inner; ++i) out[i] += tap * (in[i - k] + in[i + k]);
  }
}

/// The same across rows.
void filter_rows(const std::vector<float>& in, std::vector<float>& out, int width, int height,
                 const std::vector<float>& taps) {
  for (int y = 0; y < height; ++y) {
    float* const to = out.data() + index(0, y, width);
    const float* const middle = in.data() + index(0, y, width);
    for (int x = 0; x < width; ++x) to[x] = taps[0] * middle[x];
    for (int k = 1; k < static_cast<int>(taps.size()); ++k) {
      const float tap = taps[static_cast<std::size_t>(k)];
      const float* const above = in.data() + index(0, std::max(0, y - k), width);
      const float* const below = in.data() + index(0, std::min(height - 1, y + k), width);
      for (int x = 0; x < width; ++x) to[x] += tap * (above[x] + below[x]);
    }
  }
}

}  // namespace

Sharpener::Sharpener(int width, int height, double mm_per_px, const Sharpening& sharpening)
    : width_(width),
      height_(height),
      factor_(std::max(1, static_cast<int>(sharpening.sigma_mm / mm_per_px / 4))),
      coarse_width_((width + factor_ - 1) / factor_),
      coarse_height_((height + factor_ - 1) / factor_),
      strength_(static_cast<float>(sharpening.strength)),
      coarse_(static_cast<std::size_t>(coarse_width_) * static_cast<std::size_t>(coarse_height_)),
      between_(coarse_.size()),
      mean_(coarse_.size()),
      line_(static_cast<std::size_t>(coarse_width_)),
      sums_(static_cast<std::size_t>(width)) {
  const auto places = [this](int fine, int coarse) {
    std::vector<Place> out;
    for (int i = 0; i < fine; ++i) {
      const float at =
          std::clamp((static_cast<float>(i) + 0.5F) / static_cast<float>(factor_) - 0.5F, 0.0F,
                     static_cast<float>(coarse - 1));
      const int first = static_cast<int>(at);
      out.push_back({first, std::min(first + 1, coarse - 1), at - static_cast<float>(first)});
    }
    return out;
  };
  columns_ = places(width, coarse_width_);
  rows_ = places(height, coarse_height_);
  // Box means and bilinear reading blur by themselves; variances add.
  const double sigma = sharpening.sigma_mm / mm_per_px / factor_;
  const double own = factor_ == 1 ? 0 : (1 - 1.0 / (factor_ * factor_)) / 12 + 1.0 / 6;
  const double rest = std::sqrt(std::max(0.01, sigma * sigma - own));
  double sum = 0;
  for (int k = 0; k <= static_cast<int>(std::ceil(3 * rest)); ++k) {
    const double tap = std::exp(-0.5 * k * k / (rest * rest));
    taps_.push_back(static_cast<float>(tap));
    sum += k == 0 ? tap : 2 * tap;
  }
  for (float& tap : taps_) tap /= static_cast<float>(sum);
}

void Sharpener::take_mean(std::span<const std::int16_t> level_q6) {
  for (int y = 0; y < coarse_height_; ++y) {
    const int first = y * factor_;
    const int rows = std::min(factor_, height_ - first);
    std::ranges::fill(sums_, 0);
    for (int row = first; row < first + rows; ++row) {
      const std::int16_t* const from = level_q6.data() + index(0, row, width_);
      for (std::size_t x = 0; x < sums_.size(); ++x) {
        sums_[x] += from[x] == recon::kUntrusted ? 0 : from[x];
      }
    }
    for (int x = 0; x < coarse_width_; ++x) {
      const int columns = std::min(factor_, width_ - x * factor_);
      const auto from = sums_.begin() + std::ptrdiff_t{x} * factor_;
      coarse_[index(x, y, coarse_width_)] =
          static_cast<float>(std::accumulate(from, from + columns, 0)) /
          static_cast<float>(rows * columns);
    }
    filter_row(coarse_.data() + index(0, y, coarse_width_),
               between_.data() + index(0, y, coarse_width_), coarse_width_, taps_);
  }
  filter_rows(between_, mean_, coarse_width_, coarse_height_, taps_);
}

template <typename Store>
void Sharpener::run(std::span<const std::int16_t> level_q6, const Store& store) {
  take_mean(level_q6);
  for (int y = 0; y < height_; ++y) {
    const Place& row = rows_[static_cast<std::size_t>(y)];
    const float* const above = mean_.data() + index(0, row.first, coarse_width_);
    const float* const below = mean_.data() + index(0, row.second, coarse_width_);
    for (int x = 0; x < coarse_width_; ++x) {
      line_[static_cast<std::size_t>(x)] = above[x] + row.part * (below[x] - above[x]);
    }
    const std::size_t begin = index(0, y, width_);
    for (std::size_t x = 0; x < columns_.size(); ++x) {
      const Place& column = columns_[x];
      const float left = line_[static_cast<std::size_t>(column.first)];
      const float right = line_[static_cast<std::size_t>(column.second)];
      const float mean = left + column.part * (right - left);
      const std::int16_t level = level_q6[begin + x];
      store(begin + x, level == recon::kUntrusted,
            static_cast<float>(level) + strength_ * (static_cast<float>(level) - mean));
    }
  }
}

void Sharpener::look_up(std::span<const std::int16_t> level_q6, const recon::DepthList& list,
                        std::span<std::int16_t> out_um) {
  const int last = static_cast<int>(list.um.size()) - 1;
  run(level_q6, [&](std::size_t at, bool untrusted, float sharpened) {
    const int q6 = static_cast<int>(std::floor(sharpened + 0.5F));
    const int entry = std::clamp(q6 - list.first_q6, 0, last);
    out_um[at] = untrusted || q6 > list.covered_to_q6 ? recon::kUntrusted
                                                      : list.um[static_cast<std::size_t>(entry)];
  });
}

void Sharpener::sharpen(std::span<const std::int16_t> level_q6, std::span<std::int16_t> out_q6) {
  run(level_q6, [&](std::size_t at, bool untrusted, float sharpened) {
    out_q6[at] = untrusted ? recon::kUntrusted
                           : static_cast<std::int16_t>(
                                 std::clamp(std::floor(sharpened + 0.5F), -16320.0F, 16320.0F));
  });
}

}  // namespace dtact::chart
