#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "clients/cpp/export.hpp"
#include "proto/dtact.pb.h"

// What the messages of dtact.proto do not say by themselves: the pixels in their bytes.
namespace dtact::client {

/// The values of a depth map, row-major, in units of its `um_per_unit`; `untrusted_value` where not
/// to be believed. Throws ProtocolError for a map that does not decode.
DTACT_EXPORT [[nodiscard]] std::vector<std::int16_t> values_of(const v1::DepthMap& map);
/// The same in millimetres, NaN where untrusted.
DTACT_EXPORT [[nodiscard]] std::vector<float> millimetres_of(const v1::DepthMap& map);

/// The grey levels of a luma map, row-major. Throws ProtocolError for a map of another encoding or
/// size than it says.
DTACT_EXPORT [[nodiscard]] std::vector<std::uint8_t> pixels_of(const v1::LumaMap& map);

}  // namespace dtact::client
