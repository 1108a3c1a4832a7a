#include "clients/calibrate/lens/pin_gain.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

namespace dtact::ctl {
namespace {

using testing::Each;
using testing::HasSubstr;

constexpr double kPxPerMm = 16;

/// Two images with 7×9 pins. Each pin darkens by `levels` of its place in millimetres, scattered by
/// 5 %, under `light`.
struct GainScene {
  cv::Mat1f reference = cv::Mat1f(300, 400);
  cv::Mat1f frame;
  std::vector<Mark> marks;

  using OfPlace = std::function<double(double x, double y)>;
  GainScene(const OfPlace& light, const OfPlace& levels) {
    for (int y = 0; y < reference.rows; ++y) {
      for (int x = 0; x < reference.cols; ++x) {
        reference(y, x) = static_cast<float>(light((x - 200) / kPxPerMm, (y - 150) / kPxPerMm));
      }
    }
    frame = reference.clone();
    cv::RNG random(5);
    for (int row = -3; row <= 3; ++row) {
      for (int col = -4; col <= 4; ++col) {
        const recon::Point mm{2.5 * col, 2.5 * row};
        const recon::Point px{200 + kPxPerMm * mm.x, 150 + kPxPerMm * mm.y};
        marks.push_back({mm, px});
        const double depth = levels(mm.x, mm.y) * (1 + random.gaussian(0.05));
        const cv::Point place(static_cast<int>(px.x), static_cast<int>(px.y));
        cv::Mat1f disc(frame.size(), 0.F);
        cv::circle(disc, place, 10, cv::Scalar(depth), cv::FILLED);
        frame -= disc;
      }
    }
  }
  [[nodiscard]] PinGain choose() const { return choose_gain(reference, frame, marks, 1.6); }
};

double even(double, double) { return 150; }
/// A third of the light in the corners.
double vignette(double x, double y) { return 180 * (1 - (x * x + y * y) / 270); }

TEST(PinGain, IsNoneWherePinsDarkenAlike) {
  const PinGain found = GainScene(vignette, [](double, double) { return 20; }).choose();
  EXPECT_EQ(found.gain.shape, recon::GainShape::none);
  EXPECT_TRUE(found.gain.polynomial.empty());
  EXPECT_NEAR(found.left_out_of_each[0], 0.05, 0.015);
  EXPECT_THAT(found.left_out_ratio, Each(1.0));
  EXPECT_THAT(found.describe(), HasSubstr("none is used"));
}

TEST(PinGain, IgnoresABoardPressedInAslant) {
  const PinGain found =
      GainScene(even, [](double x, double y) { return 20 + x - 0.5 * y; }).choose();
  EXPECT_EQ(found.gain.shape, recon::GainShape::none);
  EXPECT_TRUE(found.gain.polynomial.empty());
}

TEST(PinGain, IsTheShareOfTheLightUnderAVignette) {
  const PinGain found =
      GainScene(vignette, [](double x, double y) { return vignette(x, y) / 9; }).choose();
  EXPECT_EQ(found.gain.shape, recon::GainShape::uniform);
  EXPECT_TRUE(found.gain.polynomial.empty());
  EXPECT_GT(found.left_out_of_each[0], 0.12);
  EXPECT_NEAR(found.left_out_of_each[1], 0.05, 0.015);
}

TEST(PinGain, IsAQuadraticWhereTheGelIsThickerInTheMiddle) {
  const auto gain = [](double x, double y) { return 1 + 0.004 * x * x + 0.002 * y * y; };
  const PinGain found =
      GainScene(even, [&](double x, double y) { return 20 / gain(x, y); }).choose();
  ASSERT_EQ(found.gain.polynomial.size(), 5U);
  for (const auto& [x, y] : {std::pair{10., 0.}, {0., 7.5}, {10., -7.5}}) {
    EXPECT_NEAR(found.gain.polynomial_at(x, y), gain(x, y), 0.06);
  }
  for (const double ratio : found.left_out_ratio) EXPECT_NEAR(ratio, 1, 0.05);
  EXPECT_NE(found.left_out_ratio[0], 1.0);
}

TEST(PinGain, NeedsTwelvePins) {
  GainScene scene(even, even);
  scene.marks.resize(11);
  EXPECT_THROW((void)scene.choose(), std::runtime_error);
}

}  // namespace
}  // namespace dtact::ctl
