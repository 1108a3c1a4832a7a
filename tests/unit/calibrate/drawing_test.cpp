#include "clients/calibrate/offline/drawing.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace dtact::ctl {
namespace {

TEST(Drawing, TextStaysWithinItsSize) {
  constexpr int kLeft = 3;
  constexpr int kTop = 5;
  Picture picture(40, 120, cv::Vec3b(255, 255, 255));
  draw_text(picture, {kLeft, kTop}, "-1.5 mm", cv::Scalar(0, 0, 0));
  int dark = 0;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      if (picture(y, x)[0] == 255) continue;
      ++dark;
      EXPECT_GE(y, kTop);
      EXPECT_LT(y, kTop + kTextHeight);
      EXPECT_GE(x, kLeft);
      EXPECT_LE(x, kLeft + text_width("-1.5 mm"));
    }
  }
  EXPECT_GT(dark, 50);
}

TEST(Drawing, AnImageHasThePicturesColours) {
  Picture picture(1, 2, cv::Vec3b(0, 0, 0));
  picture(0, 1) = cv::Vec3b(230, 90, 10);
  const image::Rgb8 image = to_image(picture);
  EXPECT_EQ(image.width, 2);
  EXPECT_EQ(image.height, 1);
  EXPECT_EQ(image.pixels, (std::vector<std::uint8_t>{0, 0, 0, 230, 90, 10}));
}

}  // namespace
}  // namespace dtact::ctl
