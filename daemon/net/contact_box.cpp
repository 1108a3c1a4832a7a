#include "daemon/net/contact_box.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace dtact::net {

std::optional<DepthRegion> contact_box(const pipeline::DepthFrame& frame) {
  if (!frame.has_depth || !frame.contact.touching) return std::nullopt;
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

}  // namespace dtact::net
