// How well motion is found on what real sensors see: the darkening that a ball or a board of pins
// makes in a real image is moved by computer over the sensor's untouched image, with a frame's
// noise anew, made depth by the sensor's own calibration, and followed. What a real object's motion
// does to the layer is not in it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/difference.hpp"
#include "clients/perceive/pose/tracker.hpp"
#include "tests/accuracy/real/ball_press.hpp"
#include "tests/unit/perceive/balls.hpp"

namespace dtact {
namespace {

using perceive::ContactView;
using perceive::Motion;
using perceive::Tracker;

constexpr int kSteps = 30;
constexpr double kSlideMm = 2;
constexpr double kTwistDeg = 15;
/// Of one frame of sensor_a, grey levels (high-pass standard deviation).
constexpr double kNoise = 0.98;

struct Sensor {
  const char* name;
  double mm_per_px;
};

class RealPose : public testing::TestWithParam<Sensor> {
 protected:
  void SetUp() override {
    const auto folder = sensor_folder(GetParam().name);
    if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
    folder_ = *folder;
    calibration_ = calibration::build(ball_press(load_pair(folder_, "ball"), GetParam().mm_per_px));
  }

  struct Result {
    perceive::test::Error worst;
    int lost = 0;
    std::size_t unobservable = 0;
  };

  [[nodiscard]] Result follow(const char* object, double slide_mm, double twist_deg) {
    const PressImages images = load_pair(folder_, object);
    const recon::Model& model = *calibration_.model;
    std::vector<std::uint16_t> reference;
    for (const float level : images.reference) {
      reference.push_back(static_cast<std::uint16_t>(std::lround(256 * level)));
    }
    // Without the noise of the one image, which would move with the object.
    cv::Mat1f loss;
    cv::divide(images.frame, images.reference, loss);
    cv::GaussianBlur(loss, loss, {}, 1.5);
    Tracker tracker;
    perceive::CloudMaker maker;
    perceive::PointCloud cloud;
    Result result;
    for (int step = 0; step <= kSteps; ++step) {
      const double part = static_cast<double>(step) / kSteps;
      const Motion truth = perceive::test::moved({part * slide_mm, 0, 0}, Eigen::Vector3d::UnitZ(),
                                                 part * twist_deg);
      const std::vector<std::int16_t> um = depth(model, reference, images.reference, loss, truth);
      perceive::DepthGrid grid;
      grid.width = grid.full_width = model.rectify.width;
      grid.height = grid.full_height = model.rectify.height;
      grid.mm_per_px = model.mm_per_px;
      grid.values = um;
      maker.make(grid, 1, cloud);
      const ContactView view(grid, cloud, maker.table(), 30);
      const auto& found = tracker.follow(view, static_cast<std::uint64_t>(step));
      if (found.state == Tracker::State::lost) {
        ++result.lost;
        continue;
      }
      result.unobservable = found.unobservable.size();
      keep(result.worst, perceive::test::error_of(found.alignment, truth));
    }
    fmt::print(
        "{} {}, {:.0f} mm {:.0f} deg, {} unobservable: worst {:.0f} um {:.2f} deg, {} lost\n",
        GetParam().name, object, slide_mm, twist_deg, result.unobservable, result.worst.um,
        result.worst.degrees, result.lost);
    return result;
  }

 private:
  static void keep(perceive::test::Error& worst, const perceive::test::Error& one) {
    worst.um = std::max(worst.um, one.um);
    worst.degrees = std::max(worst.degrees, one.degrees);
  }

  /// What the camera would see of the darkening after `motion`, made depth.
  [[nodiscard]] std::vector<std::int16_t> depth(const recon::Model& model,
                                                const std::vector<std::uint16_t>& reference,
                                                const cv::Mat1f& light, const cv::Mat1f& loss,
                                                const Motion& motion) {
    const double middle_x = 0.5 * (loss.cols - 1);
    const double middle_y = 0.5 * (loss.rows - 1);
    const Eigen::Matrix3d turn = motion.linear();
    const Eigen::Vector3d shift = motion.translation() * 1e3 / model.mm_per_px;
    const cv::Mat1d move =
        (cv::Mat1d(2, 3) << turn(0, 0), turn(0, 1),
         middle_x + shift.x() - turn(0, 0) * middle_x - turn(0, 1) * middle_y, turn(1, 0),
         turn(1, 1), middle_y + shift.y() - turn(1, 0) * middle_x - turn(1, 1) * middle_y);
    cv::Mat1f moved;
    cv::warpAffine(loss, moved, move, loss.size(), cv::INTER_CUBIC, cv::BORDER_CONSTANT, 1.0);
    std::normal_distribution<double> noise(0, kNoise);
    image::Grey8 frame{loss.cols, loss.rows, {}};
    for (int row = 0; row < loss.rows; ++row) {
      for (int column = 0; column < loss.cols; ++column) {
        const double level =
            static_cast<double>(light(row, column)) * static_cast<double>(moved(row, column)) +
            noise(random_);
        frame.pixels.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(level), 0L, 255L)));
      }
    }
    std::vector<std::int16_t> um;
    for (const float value : calibration::mean_depth_um(model, reference, {&frame, 1})) {
      um.push_back(std::isnan(value) ? std::int16_t{-32768}
                                     : static_cast<std::int16_t>(std::lround(value)));
    }
    return um;
  }

  std::filesystem::path folder_;
  calibration::Calibration calibration_;
  std::mt19937 random_{1};
};

TEST_P(RealPose, ABoardOfPinsSlidesAndTwists) {
  for (const auto& [slide_mm, twist_deg] : {std::pair{kSlideMm, 0.0}, {0.0, kTwistDeg}}) {
    const Result result = follow("board", slide_mm, twist_deg);
    EXPECT_EQ(result.lost, 0);
    EXPECT_EQ(result.unobservable, 0U);
    EXPECT_LT(result.worst.um, 15);
    EXPECT_LT(result.worst.degrees, 0.2);
  }
}

// sensor_b's lopsided press looks as if it showed two of a ball's three turns, and slides by up to
// 0.13 mm where it turns.
TEST_P(RealPose, ABallSlidesAndTurns) {
  for (const auto& [slide_mm, twist_deg] : {std::pair{kSlideMm, 0.0}, {0.0, kTwistDeg}}) {
    const Result result = follow("ball", slide_mm, twist_deg);
    EXPECT_EQ(result.lost, 0);
    EXPECT_LT(result.worst.um, 150);
    EXPECT_LT(result.worst.degrees, 2);
  }
}

// The published scales of the two sensors.
INSTANTIATE_TEST_SUITE_P(Sensors, RealPose,
                         testing::Values(Sensor{"sensor_a", 0.0510}, Sensor{"sensor_b", 0.05317}),
                         [](const auto& tested) { return std::string(tested.param.name); });

}  // namespace
}  // namespace dtact
