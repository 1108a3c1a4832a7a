#include "daemon/pipeline/reference/reference_average.hpp"

#include <algorithm>
#include <stdexcept>

namespace dtact::pipeline {

ReferenceAverage::ReferenceAverage(int width, int height, int frames)
    : width_(width),
      height_(height),
      frames_(frames),
      sums_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
  if (frames < 1 || frames > 256) {
    throw std::invalid_argument("reference: frames must be 1 to 256");
  }
}

void ReferenceAverage::reset() noexcept {
  std::ranges::fill(sums_, std::uint16_t{0});
  added_ = 0;
}

bool ReferenceAverage::add(const hal::LumaView& luma) noexcept {
  for (int y = 0; y < height_; ++y) {
    const std::uint8_t* in = luma.row(y);
    std::uint16_t* sums = sums_.data() + std::ptrdiff_t{y} * width_;
    for (int x = 0; x < width_; ++x) sums[x] = static_cast<std::uint16_t>(sums[x] + in[x]);
  }
  return ++added_ >= frames_;
}

void ReferenceAverage::write(std::span<std::uint16_t> out_q8) const noexcept {
  const auto n = static_cast<std::uint32_t>(added_);
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    out_q8[i] = static_cast<std::uint16_t>((std::uint32_t{sums_[i]} * 256U + n / 2) / n);
  }
}

}  // namespace dtact::pipeline
