#include "clients/perceive/depth_crop.hpp"

#include <algorithm>
#include <climits>

#include "clients/common/depth_message.hpp"

namespace dtact::perceive {

DepthCrop::DepthCrop(const v1::DepthMap& map)
    : values_(cli::depths_of(map)),
      whole_(cli::grid_of(map, values_)),
      decimation_(std::max(1, static_cast<int>(map.decimation()))) {}

std::optional<DepthGrid> DepthCrop::crop(int left, int top, int right, int bottom) {
  left = std::max(left, whole_.x);
  top = std::max(top, whole_.y);
  right = std::min(right, whole_.x + whole_.width);
  bottom = std::min(bottom, whole_.y + whole_.height);
  if (left >= right || top >= bottom) return std::nullopt;
  DepthGrid part = whole_;
  part.x = left;
  part.y = top;
  part.width = right - left;
  part.height = bottom - top;
  cut_.clear();
  for (int row = top; row < bottom; ++row) {
    const auto* from =
        values_.data() + std::ptrdiff_t{row - whole_.y} * whole_.width + (left - whole_.x);
    cut_.insert(cut_.end(), from, from + part.width);
  }
  part.values = cut_;
  return part;
}

std::optional<DepthGrid> DepthCrop::cut(const net::DepthRegion& region) {
  const auto of_map = [this](std::int64_t pixel) {
    return static_cast<int>(std::min<std::int64_t>(pixel / decimation_, INT_MAX));
  };
  const auto end = [&](std::uint32_t pixel, std::uint32_t size) {
    return of_map(std::int64_t{pixel} + size + decimation_ - 1);
  };
  return crop(of_map(region.x), of_map(region.y), end(region.x, region.width),
              end(region.y, region.height));
}

std::optional<DepthGrid> DepthCrop::contact(const v1::Contact& contact) {
  const double um = 1000 * std::min(contact.threshold_mm(), contact.deepest_mm() / 2);
  // In this order NaN becomes a number as well.
  constexpr double kMaxUnits = INT16_MAX;
  const auto threshold =
      static_cast<int>(std::max(0.0, std::min(kMaxUnits, um / whole_.um_per_unit)));
  int left = whole_.width;
  int right = -1;
  int top = whole_.height;
  int bottom = -1;
  for (int row = 0; row < whole_.height; ++row) {
    const auto* begin = values_.data() + std::ptrdiff_t{row} * whole_.width;
    for (int column = 0; column < whole_.width; ++column) {
      if (begin[column] <= threshold) continue;
      left = std::min(left, column);
      right = std::max(right, column);
      top = std::min(top, row);
      bottom = row;
    }
  }
  if (bottom < 0) return std::nullopt;
  const int margin = kMarginPx / decimation_;
  return crop(whole_.x + left - margin, whole_.y + top - margin, whole_.x + right + 1 + margin,
              whole_.y + bottom + 1 + margin);
}

}  // namespace dtact::perceive
