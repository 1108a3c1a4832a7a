#include "clients/calibrate/offline/drawing.hpp"

#include <algorithm>
#include <string>

namespace dtact::ctl {
namespace {

constexpr int kGlyphWidth = 5;
constexpr int kGlyphHeight = 7;
constexpr int kZoom = kTextHeight / kGlyphHeight;
constexpr int kAdvance = (kGlyphWidth + 1) * kZoom;

struct Glyph {
  char letter;
  std::array<const char*, kGlyphHeight> rows;
};

constexpr Glyph kGlyphs[] = {
    {'0', {".###.", "#...#", "#..##", "#.#.#", "##..#", "#...#", ".###."}},
    {'1', {"..#..", ".##..", "..#..", "..#..", "..#..", "..#..", ".###."}},
    {'2', {".###.", "#...#", "....#", "...#.", "..#..", ".#...", "#####"}},
    {'3', {"#####", "...#.", "..#..", "...#.", "....#", "#...#", ".###."}},
    {'4', {"...#.", "..##.", ".#.#.", "#..#.", "#####", "...#.", "...#."}},
    {'5', {"#####", "#....", "####.", "....#", "....#", "#...#", ".###."}},
    {'6', {"..##.", ".#...", "#....", "####.", "#...#", "#...#", ".###."}},
    {'7', {"#####", "....#", "...#.", "..#..", ".#...", ".#...", ".#..."}},
    {'8', {".###.", "#...#", "#...#", ".###.", "#...#", "#...#", ".###."}},
    {'9', {".###.", "#...#", "#...#", ".####", "....#", "...#.", ".##.."}},
    {'.', {".....", ".....", ".....", ".....", ".....", ".##..", ".##.."}},
    {'-', {".....", ".....", ".....", "#####", ".....", ".....", "....."}},
    {'+', {".....", "..#..", "..#..", "#####", "..#..", "..#..", "....."}},
    {'m', {".....", ".....", "##.#.", "#.#.#", "#.#.#", "#.#.#", "#.#.#"}},
};

}  // namespace

image::Rgb8 canvas(int width, int height, Colour colour) {
  image::Rgb8 image{width, height, {}};
  image.pixels.resize(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  fill(image, 0, 0, width, height, colour);
  return image;
}

void fill(image::Rgb8& image, int left, int top, int width, int height, Colour colour) {
  for (int y = std::max(0, top); y < std::min(image.height, top + height); ++y) {
    for (int x = std::max(0, left); x < std::min(image.width, left + width); ++x) {
      const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                         static_cast<std::size_t>(x);
      std::ranges::copy(colour, image.pixels.begin() + static_cast<std::ptrdiff_t>(3 * pixel));
    }
  }
}

int text_width(std::string_view text) {
  return static_cast<int>(text.size()) * kAdvance - (text.empty() ? 0 : kZoom);
}

void draw_text(image::Rgb8& image, int left, int top, std::string_view text, Colour colour) {
  for (const char letter : text) {
    const auto* glyph = std::ranges::find(kGlyphs, letter, &Glyph::letter);
    if (glyph != std::end(kGlyphs)) {
      int y = top;
      for (const std::string_view row : glyph->rows) {
        int x = left;
        for (const char dot : row) {
          if (dot == '#') fill(image, x, y, kZoom, kZoom, colour);
          x += kZoom;
        }
        y += kZoom;
      }
    }
    left += kAdvance;
  }
}

}  // namespace dtact::ctl
