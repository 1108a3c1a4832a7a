#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

#include "daemon/serve/encoded_frame.hpp"

namespace dtact::web {

/// A frame of the daemon's as it came, for any number of viewers.
struct RelayedFrame {
  /// Without `dropped`, which is each viewer's own.
  std::shared_ptr<const net::EncodedFrame> encoded;
  std::int64_t monotonic_ns = 0;  ///< As Frame.monotonic_ns.
  std::uint64_t dropped = 0;      ///< As Frame.dropped: those that the gateway missed.
  /// Which parts it holds: a bit for the number of each field that is a map or a picture.
  std::uint32_t parts = 0;
};

/// Reads a serialized ServerMessage. Empty when it is no frame. What is copied is the body, once;
/// maps are not looked into.
[[nodiscard]] std::optional<RelayedFrame> relay(std::string_view message);

}  // namespace dtact::web
