#pragma once

#include <string_view>

namespace dtact::net {

/// Whether a serialized ClientMessage takes little more memory when it is parsed than it has bytes:
/// it has an upload_calibration, its id and on whose behalf it comes, and few fields in all. Other
/// messages may take thirty times as much, since a field of two bytes becomes an object.
[[nodiscard]] bool is_plain_upload(std::string_view bytes);

}  // namespace dtact::net
