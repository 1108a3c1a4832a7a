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
  std::vector<std::int16_t> taps(weight.size());
  int rest = kernels::kTapOne;
  for (std::size_t k = 1; k < taps.size(); ++k) {
    taps[k] = static_cast<std::int16_t>(std::lround(kernels::kTapOne * weight[k] / sum));
    rest -= 2 * taps[k];
  }
  taps[0] = static_cast<std::int16_t>(rest);
  return taps;
}

RowBuffer::RowBuffer(int rows, int width)
    : stride_(static_cast<std::size_t>(kernels::padded(width)) +
              std::size_t{2} * kernels::kMaxRadius),
      data_(stride_ * static_cast<std::size_t>(rows)) {}

std::span<std::int16_t> RowBuffer::at(int y) noexcept {
  return std::span(data_).subspan(static_cast<std::size_t>(y) * stride_, stride_);
}

Smoother::Smoother(std::vector<std::int16_t> taps, int width, int height)
    : taps_(std::move(taps)),
      radius_(static_cast<int>(taps_.size()) - 1),
      width_(width),
      height_(height),
      ring_rows_(2 * radius_ + 1 + kStrip),
      ring_(ring_rows_, width),
      span_(2 * taps_.size() - 1) {}

void Smoother::push(std::int16_t* row) noexcept {
  std::fill_n(row - radius_, radius_, row[0]);
  std::fill_n(row + width_, radius_, row[width_ - 1]);
  kernels::smooth_horizontal_row(row, taps_, kernels::padded(width_),
                                 ring_.row(pushed_ % ring_rows_));
  ++pushed_;
}

int Smoother::ready() const noexcept {
  return pushed_ == height_ ? height_ : std::max(0, pushed_ - radius_);
}

void Smoother::take(int y, std::int16_t* out) noexcept {
  int row = y - radius_;
  for (const std::int16_t*& source : span_) {
    source = ring_.row(std::clamp(row++, 0, height_ - 1) % ring_rows_);
  }
  kernels::smooth_vertical_row(span_.data(), taps_, kernels::padded(width_), out);
}

}  // namespace dtact::recon
