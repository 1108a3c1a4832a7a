// Doubts that dtact-calibrate reports on real ball presses: none about healthy ones, and the cause
// where scale, radius, light or picture are wrong.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "clients/calibrate/fit/evaluate.hpp"
#include "tests/accuracy/real/ball_press.hpp"
#include "tests/accuracy/real/folder_evaluation.hpp"

namespace dtact::ctl {
namespace {

using calibration::BallPress;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<std::string> doubts_of(const BallPress& press) {
  return calibration::doubts_about(calibration::build(press), press);
}

class PlausiblePress : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    folder_ = sensor_folder(GetParam());
    if (!folder_) GTEST_SKIP() << "the real images are not beside the repository";
    images_ = load_pair(*folder_, "ball");
  }
  [[nodiscard]] static double scale() {
    return GetParam() == std::string("sensor_a") ? 0.05102 : 0.05317;
  }
  std::optional<std::filesystem::path> folder_;
  PressImages images_;
};

TEST_P(PlausiblePress, NothingIsSaidOfHealthyOnes) {
  for (const PressImages& images :
       {images_, turned(images_), dark_corners(images_), leaking(images_)}) {
    EXPECT_THAT(doubts_of(ball_press(images, scale())), IsEmpty());
  }
  BallPress published = ball_press(images_, scale());
  published.method = recon::Method::published;
  EXPECT_THAT(doubts_of(published), IsEmpty());
  // The scale is a tenth too small: one press does not show it.
  EXPECT_THAT(doubts_of(ball_press(images_, 0.9 * scale())), IsEmpty());
}

TEST_P(PlausiblePress, NothingIsSaidOfThemThroughTheirLens) {
  const FolderEvaluation e = evaluate_folder(*folder_, {}, 4.0);
  ASSERT_TRUE(e.ball && e.calibration);
  fmt::print("{}: offset {:.3f} mm, shape {:.3f} mm\n", GetParam(), e.ball->offset_mm,
             e.ball->mae_mm);
  EXPECT_THAT(calibration::doubts_about(*e.ball), IsEmpty());
  EXPECT_THAT(calibration::doubts_about(e.calibration->model->lut), IsEmpty());
}

TEST_P(PlausiblePress, ADecimalPointOff) {
  EXPECT_THAT(doubts_of(ball_press(images_, 0.1 * scale())),
              Contains(HasSubstr("a grey level is")));
  EXPECT_THAT(doubts_of(ball_press(images_, scale(), 40)), Contains(HasSubstr("a grey level is")));
}

TEST_P(PlausiblePress, APressHalfInTheDark) {
  // Both images are black from a column within the contact on.
  for (const double part : {0.52, 0.55}) {
    PressImages dark{images_.reference.clone(), images_.frame.clone()};
    const int from = static_cast<int>(part * dark.frame.cols);
    for (cv::Mat1f* image : {&dark.reference, &dark.frame}) {
      image->colRange(from, image->cols) *= 0.03F;
    }
    EXPECT_FALSE(doubts_of(ball_press(dark, scale())).empty()) << part;
  }
}

TEST_P(PlausiblePress, APressInACornerThatIsDark) {
  // Light that falls to a third from the contact's middle to the left, within 3 mm.
  PressImages dark{images_.reference.clone(), images_.frame.clone()};
  for (cv::Mat1f* image : {&dark.reference, &dark.frame}) {
    for (int x = 0; x < image->cols; ++x) {
      const double mm = scale() * (x - 0.55 * image->cols);
      image->col(x) *= 1 - (2.0 / 3) / (1 + std::exp(2 * (mm + 1.5)));
    }
  }
  EXPECT_THAT(doubts_of(ball_press(dark, scale())),
              Contains(HasSubstr("less than half of the light")));
}

INSTANTIATE_TEST_SUITE_P(Sensors, PlausiblePress, testing::Values("sensor_a", "sensor_b"),
                         [](const auto& sensor) { return std::string(sensor.param); });

// The press of sensor_a is 1.9 mm deep, almost half of the radius, so scale and radius show.
TEST(PlausibleDeepPress, AWrongScaleRadiusOrLight) {
  const auto folder = sensor_folder("sensor_a");
  if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
  const PressImages images = load_pair(*folder, "ball");
  const auto disagree = Contains(HasSubstr("LUT and sphere disagree"));
  EXPECT_THAT(doubts_of(ball_press(images, 0.0552)), disagree);
  EXPECT_THAT(doubts_of(ball_press(images, 1.05 * 0.0510)), disagree);
  EXPECT_THAT(doubts_of(ball_press(images, 0.0510, 3.5)), disagree);
  EXPECT_THAT(doubts_of(ball_press(images, 0.0510, 3)), disagree);
  EXPECT_THAT(doubts_of(ball_press(tilted(images), 0.0510)), disagree);
}

}  // namespace
}  // namespace dtact::ctl
