#include "clients/perceive/depth_crop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "clients/cpp/errors.hpp"
#include "clients/cpp/maps.hpp"
#include "daemon/recon/rectify.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {

namespace {

/// Like client::values_of(), which checks only the values. Throws client::ProtocolError also where
/// the map contradicts itself.
std::vector<std::int16_t> values_of(const v1::DepthMap& map) {
  const std::uint64_t full_width = map.full_width();
  const std::uint64_t full_height = map.full_height();
  const bool inside = std::uint64_t{map.x()} + map.width() <= full_width &&
                      std::uint64_t{map.y()} + map.height() <= full_height;
  const bool scaled = map.mm_per_px() > 0 && std::isfinite(map.mm_per_px()) &&
                      map.um_per_unit() > 0 && std::isfinite(map.um_per_unit());
  if (inside && scaled && full_width * full_height <= std::uint64_t{recon::kMaxMapPixels}) {
    return client::values_of(map);
  }
  throw client::ProtocolError(fmt::format(
      "a depth map of {}x{} pixels at {}, {} of {}x{}, {} mm a pixel and {} um a unit contradicts "
      "itself: check the daemon's version",
      map.width(), map.height(), map.x(), map.y(), full_width, full_height, map.mm_per_px(),
      map.um_per_unit()));
}

}  // namespace

DepthCrop::DepthCrop(const v1::DepthMap& map)
    : values_(values_of(map)),
      whole_{.x = static_cast<int>(map.x()),
             .y = static_cast<int>(map.y()),
             .width = static_cast<int>(map.width()),
             .height = static_cast<int>(map.height()),
             .full_width = static_cast<int>(map.full_width()),
             .full_height = static_cast<int>(map.full_height()),
             .mm_per_px = map.mm_per_px(),
             .um_per_unit = map.um_per_unit(),
             .untrusted = map.untrusted_value(),
             .values = values_},
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
  const auto begin = [this](std::uint32_t pixel) { return static_cast<int>(pixel) / decimation_; };
  const auto end = [this](std::uint32_t pixel, std::uint32_t size) {
    return static_cast<int>((std::uint64_t{pixel} + size + static_cast<unsigned>(decimation_) - 1) /
                            static_cast<unsigned>(decimation_));
  };
  return crop(begin(region.x), begin(region.y), end(region.x, region.width),
              end(region.y, region.height));
}

std::optional<DepthGrid> DepthCrop::contact(double deepest_mm) {
  const double um = std::min(kContactUm, 1000 * deepest_mm / 2);
  const auto threshold = static_cast<int>(um / whole_.um_per_unit);
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
