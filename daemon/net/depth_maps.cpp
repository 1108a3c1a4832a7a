#include "daemon/net/depth_maps.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "daemon/recon/model.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {

std::optional<DepthRegion> contact_box(const pipeline::DepthFrame& frame) {
  if (!frame.has_depth || !frame.contact.in_contact) return std::nullopt;
  int left = frame.width;
  int right = -1;
  int top = frame.height;
  int bottom = -1;
  for (int y = 0; y < frame.height; ++y) {
    const auto* const row =
        frame.depth_um.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width);
    const auto* const end = row + frame.width;
    // Without an exit, so that the compiler makes vectors of it: most rows have no contact.
    std::int16_t deepest = INT16_MIN;
    for (const auto* pixel = row; pixel != end; ++pixel) deepest = std::max(deepest, *pixel);
    if (deepest <= frame.contact_um) continue;
    const auto pressed = [&](std::int16_t um) { return um > frame.contact_um; };
    const auto* const first = std::find_if(row, end, pressed);
    const auto* last = end;
    while (!pressed(*(last - 1))) --last;
    left = std::min(left, static_cast<int>(first - row));
    right = std::max(right, static_cast<int>(last - row) - 1);
    top = std::min(top, y);
    bottom = y;
  }
  if (bottom < 0) return std::nullopt;
  const auto begin = [&](int pixel) {
    return std::max(0, pixel * frame.decimation - kContactMargin);
  };
  const auto finish = [&](int pixel) { return (pixel + 1) * frame.decimation + kContactMargin; };
  const int x = begin(left);
  const int y = begin(top);
  return DepthRegion{static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y),
                     static_cast<std::uint32_t>(finish(right) - x),
                     static_cast<std::uint32_t>(finish(bottom) - y)};
}

void DepthMaps::begin(const pipeline::DepthFrame& frame) noexcept {
  frame_ = &frame;
  views_made_ = 0;
  encoded_made_ = 0;
}

void DepthMaps::forget() noexcept {
  views_.clear();
  views_made_ = 0;
  encoded_.clear();
  encoded_made_ = 0;
}

const DepthMaps::View& DepthMaps::view(const DepthSpec& spec, bool contact_box) {
  for (std::size_t i = 0; i < views_made_; ++i) {
    if (views_[i].spec == spec && views_[i].contact_box == contact_box) return views_[i];
  }
  if (views_made_ == views_.size()) views_.emplace_back();
  View& view = views_[views_made_++];
  view.spec = spec;
  view.contact_box = contact_box;
  view.made.reset();
  DepthSpec where = spec;
  if (contact_box) {
    where.region = net::contact_box(*frame_);
    if (!where.region) return view;
  }
  view.made = view.viewer.view(*frame_, where);
  return view;
}

const DepthMaps::Map* DepthMaps::get(int encoding, const DepthSpec& spec, bool contact_box) {
  const View& seen = view(spec, contact_box);
  if (!seen.made) return nullptr;
  for (std::size_t i = 0; i < encoded_made_; ++i) {
    if (encoded_[i].view == &seen && encoded_[i].encoding == encoding) return &encoded_[i].map;
  }
  if (encoded_made_ == encoded_.size()) encoded_.emplace_back();
  Encoded& encoded = encoded_[encoded_made_++];
  encoded.view = &seen;
  encoded.encoding = encoding;
  encode(*seen.made, encoding, encoded.map);
  return &encoded.map;
}

void DepthMaps::encode(const DepthView& view, int encoding, Map& map) {
  v1::DepthMap head;
  head.set_encoding(static_cast<v1::DepthEncoding>(encoding));
  head.set_width(static_cast<std::uint32_t>(view.width));
  head.set_height(static_cast<std::uint32_t>(view.height));
  head.set_mm_per_px(view.mm_per_px);
  head.set_um_per_unit(view.um_per_unit);
  head.set_untrusted_value(recon::kUntrusted);
  head.set_decimation(static_cast<std::uint32_t>(view.decimation));
  head.set_uncertainty_um(frame_->uncertainty_um);
  head.set_x(static_cast<std::uint32_t>(view.x));
  head.set_y(static_cast<std::uint32_t>(view.y));
  head.set_full_width(static_cast<std::uint32_t>(view.full_width));
  head.set_full_height(static_cast<std::uint32_t>(view.full_height));
  head.set_sharpen_steps(static_cast<std::uint32_t>(frame_->sharpen_steps));
  if (frame_->made_decimation > view.decimation) {
    head.set_made_decimation(static_cast<std::uint32_t>(frame_->made_decimation));
  }
  head.SerializeToString(&map.head);
  encoder_.encode(head.encoding(), view.values, static_cast<std::size_t>(view.width), map.data);
}

}  // namespace dtact::net
