#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "hal/image/png.hpp"

namespace dtact::ctl {

using Colour = std::array<std::uint8_t, 3>;  ///< r, g, b

/// A canvas of one colour.
[[nodiscard]] image::Rgb8 canvas(int width, int height, Colour colour);

/// What lies outside the canvas is left out.
void fill(image::Rgb8& image, int left, int top, int width, int height, Colour colour);

/// Height of a line of text, pixels.
inline constexpr int kTextHeight = 14;
/// Width of a text, pixels.
[[nodiscard]] int text_width(std::string_view text);
/// Digits, '.', '-', '+', 'm' and blanks; others are blank.
void draw_text(image::Rgb8& image, int left, int top, std::string_view text, Colour colour);

}  // namespace dtact::ctl
