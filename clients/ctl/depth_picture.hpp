#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "proto/dtact.pb.h"

namespace dtact::ctl {

/// A colour of the screen, each part 0 … 255.
struct Colour {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
  bool operator==(const Colour&) const = default;
};

/// From dark violet (0) over green to pale yellow (1): lightness grows all the way, so the order is
/// seen without telling hues apart. Green's cubehelix (Bull. Astr. Soc. India 39, 289, 2011).
[[nodiscard]] Colour colour_of(double share);

/// How a terminal is told a colour.
enum class Palette : std::uint8_t { xterm256, rgb };

/// What there is to draw on.
struct Canvas {
  int columns = 80;
  int rows = 24;
  Palette palette = Palette::rgb;
};
inline constexpr int kLeastColumns = 24;
inline constexpr int kLeastRows = 9;

/// The least of 0.2, 0.5, 1, 2, 5, … mm that `deepest_mm` does not exceed: the depth of the
/// brightest colour.
[[nodiscard]] double full_scale_mm(double deepest_mm);

/// The depth map of `frame` as lines of a terminal, at most columns × (rows − 1), no smaller than
/// kLeastColumns × kLeastRows: two pixels a character, a cross at the middle of the contact, a
/// legend of depth and length below. Untrusted pixels are grey. Throws client::ProtocolError for a
/// map that does not decode.
[[nodiscard]] std::vector<std::string> picture_of(const v1::Frame& frame, double full_scale_mm,
                                                  const Canvas& canvas);

}  // namespace dtact::ctl
