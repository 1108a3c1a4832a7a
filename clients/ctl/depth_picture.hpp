#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/common/colours.hpp"
#include "proto/dtact.pb.h"

namespace dtact::ctl {

using cli::Colour;

/// Colour codes of the terminal.
enum class Palette : std::uint8_t { xterm256, rgb };

/// What there is to draw on.
struct Canvas {
  int columns = 80;
  int rows = 24;
  Palette palette = Palette::rgb;
};
inline constexpr int kMinColumns = 24;
inline constexpr int kMinRows = 9;

/// The depth map of `frame` as lines of a terminal, at most columns × (rows − 1), no smaller than
/// kMinColumns × kMinRows: two pixels a character, a cross at the middle of the contact, a
/// legend of depth and length below. Untrusted pixels are grey. Throws client::ProtocolError for a
/// map that does not decode.
[[nodiscard]] std::vector<std::string> picture_of(const v1::Frame& frame, double full_scale_mm,
                                                  const Canvas& canvas);

}  // namespace dtact::ctl
