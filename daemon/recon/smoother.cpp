#include "daemon/recon/smoother.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace dtact::recon {

std::vector<std::int16_t> gaussian_taps(double sigma_px) {
  // Three standard deviations leave 0.3 % of the weight out.
  if (!(sigma_px >= 0) || std::ceil(3 * sigma_px) > kernels::kMaxRadius) {
    throw std::invalid_argument("smoothing: sigma must be 0 to 10 pixels");
  }
  const int radius = static_cast<int>(std::ceil(3 * sigma_px));
  std::vector<double> weight(static_cast<std::size_t>(radius) + 1, 1.0);
  double sum = 1;
  for (int k = 1; k <= radius; ++k) {
    weight[static_cast<std::size_t>(k)] = std::exp(-0.5 * k * k / (sigma_px * sigma_px));
    sum += 2 * weight[static_cast<std::size_t>(k)];
  }
  std::vector<std::int16_t> taps{0};
  int rest = kernels::kTapOne;
  for (std::size_t k = 1; k < weight.size(); ++k) {
    taps.push_back(static_cast<std::int16_t>(std::lround(kernels::kTapOne * weight[k] / sum)));
    rest -= 2 * taps.back();
  }
  taps.front() = static_cast<std::int16_t>(rest);
  return taps;
}

RowBuffer::RowBuffer(int rows, int width)
    : stride_(static_cast<std::size_t>(vec::padded(width)) + std::size_t{2} * kernels::kMaxRadius),
      data_(stride_ * static_cast<std::size_t>(rows)) {}

std::span<std::int16_t> RowBuffer::at(int y) noexcept {
  return std::span(data_).subspan(static_cast<std::size_t>(y) * stride_, stride_);
}

Smoother::Smoother(std::span<const std::int16_t> taps, int width, int height)
    : taps_(taps),
      width_(width),
      height_(height),
      pairs_((height + 1) / 2),
      ring_pairs_(kStrip + 2 * reach()),
      pair_size_(2 * static_cast<std::size_t>(vec::padded(width))),
      ring_(pair_size_ * static_cast<std::size_t>(ring_pairs_ + 2)),
      span_(static_cast<std::size_t>(taps_.count())) {}

std::int16_t* Smoother::ring(int slot) noexcept {
  return ring_.data() + static_cast<std::size_t>(slot) * pair_size_;
}

void Smoother::replicate_sides(std::int16_t* row, int first, int last) const noexcept {
  if (first == 0) std::fill_n(row - radius(), radius(), row[0]);
  if (last * vec::kBlock + radius() > width_) std::fill_n(row + width_, radius(), row[width_ - 1]);
}

void Smoother::push(int pair, std::int16_t* row_a, std::int16_t* row_b, int first,
                    int last) noexcept {
  if (2 * pair + 1 == height_) row_b = row_a;
  replicate_sides(row_a, first, last);
  replicate_sides(row_b, first, last);
  vec::smooth_across(row_a, row_b, taps_, first, last, ring(pair % ring_pairs_));
  if (pair == 0) vec::smooth_across(row_a, row_a, taps_, first, last, ring(ring_pairs_));
  if (pair == pairs_ - 1) {
    vec::smooth_across(row_b, row_b, taps_, first, last, ring(ring_pairs_ + 1));
  }
}

void Smoother::take(int pair, std::int16_t* row_a, std::int16_t* row_b, int first,
                    int last) noexcept {
  for (std::size_t k = 0; k < span_.size(); ++k) {
    const int source = pair - reach() + static_cast<int>(k);
    const int slot = source < 0         ? ring_pairs_
                     : source >= pairs_ ? ring_pairs_ + 1
                                        : source % ring_pairs_;
    span_[k] = ring(slot);
  }
  vec::smooth_down(span_.data(), taps_, first, last, row_a, row_b);
}

}  // namespace dtact::recon
