#pragma once

#include <cstdint>

namespace dtact::cli {

// The colours of every picture of depth: in a terminal, in a file, with a legend.

/// Each part 0 … 255.
struct Colour {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
  bool operator==(const Colour&) const = default;
};

/// From dark violet (0) over green to pale yellow (1). Lightness increases throughout, so the order
/// shows without distinct hues. Green's cubehelix (Bull. Astr. Soc. India 39, 289, 2011).
[[nodiscard]] Colour colour_of(double share);

/// An untrusted pixel; none of the scale's colours is grey.
inline constexpr Colour kUntrustedColour{96, 96, 96};

/// The least of 1, 2, 5 times a power of ten that is at least `value` (above 0).
[[nodiscard]] double round_up(double value);

/// The depth of the brightest colour: the least of 0.2, 0.5, 1, 2, 5, … mm that `deepest_mm` does
/// not exceed.
[[nodiscard]] double full_scale_mm(double deepest_mm);

}  // namespace dtact::cli
