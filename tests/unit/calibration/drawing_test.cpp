#include "clients/calibrate/offline/drawing.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace dtact::ctl {
namespace {

constexpr Colour kWhite{255, 255, 255};
constexpr Colour kBlack{0, 0, 0};

long black(const image::Rgb8& image) { return std::ranges::count(image.pixels, 0) / 3; }

TEST(Drawing, FillsAndClips) {
  image::Rgb8 image = canvas(10, 8, kWhite);
  EXPECT_EQ(image.pixels.size(), 240U);
  fill(image, 2, 3, 4, 2, kBlack);
  EXPECT_EQ(black(image), 8);
  fill(image, -5, -5, 6, 6, kBlack);
  EXPECT_EQ(black(image), 9);
  fill(image, 9, 7, 100, 100, kBlack);
  EXPECT_EQ(black(image), 10);
}

TEST(Drawing, TextIsAsWideAsItSays) {
  EXPECT_EQ(text_width(""), 0);
  EXPECT_EQ(text_width("1"), 10);
  EXPECT_EQ(text_width("-1.5 mm"), 82);
  image::Rgb8 image = canvas(100, kTextHeight, kWhite);
  draw_text(image, 0, 0, "8888", kBlack);
  for (int y = 0; y < image.height; ++y) {
    for (int x = text_width("8888"); x < image.width; ++x) {
      const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                         static_cast<std::size_t>(x);
      ASSERT_EQ(image.pixels[3 * pixel], 255);
    }
  }
  EXPECT_EQ(black(image), 4L * 17 * 4) << "an 8 has 17 dots of 2 x 2 pixels";
}

TEST(Drawing, UnknownLettersAreBlank) {
  image::Rgb8 image = canvas(40, kTextHeight, kWhite);
  draw_text(image, 0, 0, "?x", kBlack);
  EXPECT_EQ(black(image), 0);
}

}  // namespace
}  // namespace dtact::ctl
