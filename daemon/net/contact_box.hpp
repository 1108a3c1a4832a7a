#pragma once

#include <optional>

#include "daemon/net/depth_view.hpp"
#include "daemon/pipeline/depth_frame.hpp"

namespace dtact::net {

/// Pixels of the calibration's resolution that are sent around a contact.
inline constexpr int kContactMargin = 16;

/// The box around what is pressed deeper than the contact threshold, kContactMargin larger on each
/// side and not cut at the map's far borders. Nothing while nothing touches.
[[nodiscard]] std::optional<DepthRegion> contact_box(const pipeline::DepthFrame& frame);

}  // namespace dtact::net
