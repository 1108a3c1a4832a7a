#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "clients/cpp/export.hpp"
#include "proto/dtact.pb.h"

// Decodes the pixels in the messages of dtact.proto.
namespace dtact::client {

/// The values of a depth map, row-major, in units of its `um_per_unit`; `untrusted_value` marks
/// untrusted pixels. Throws ProtocolError for a map that does not decode.
DTACT_EXPORT [[nodiscard]] std::vector<std::int16_t> values_of(const v1::DepthMap& map);
/// The same in millimetres, NaN where untrusted.
DTACT_EXPORT [[nodiscard]] std::vector<float> millimetres_of(const v1::DepthMap& map);

/// The grey levels of a luma map, row-major. Throws ProtocolError for an unknown encoding or a size
/// that does not match.
DTACT_EXPORT [[nodiscard]] std::vector<std::uint8_t> pixels_of(const v1::LumaMap& map);

}  // namespace dtact::client
