#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace dtact::wire {

/// Most pixels of a map on the wire: its int16 form has to fit a message.
inline constexpr std::size_t kMaxPixels = std::size_t{8} << 20U;

/// Whether a map of that size may be on the wire: it has pixels, and not too many.
[[nodiscard]] constexpr bool plausible_size(std::size_t width, std::size_t height) noexcept {
  return width > 0 && height > 0 && width <= kMaxPixels && height <= kMaxPixels / width;
}

/// Throws std::invalid_argument unless `pixels` are a whole number of rows.
inline void require_whole_rows(std::size_t pixels, std::size_t width) {
  if (width == 0 || pixels % width != 0) {
    throw std::invalid_argument("a depth map of " + std::to_string(pixels) +
                                " pixels has no whole number of rows of " + std::to_string(width));
  }
}

}  // namespace dtact::wire
