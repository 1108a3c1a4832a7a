// Accuracy of motion on images of real sensors with synthetic motion. The darkening of a ball or a
// board of pins in a real image is moved over the sensor's reference image, with new noise for each
// frame, converted to depth by the sensor's own calibration, and tracked. The gel's response to
// motion is not included.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/perceive/frame_maker.hpp"
#include "proto/dtact.pb.h"
#include "tests/accuracy/real/ball_press.hpp"
#include "tests/accuracy/whole/pose_track.hpp"

namespace dtact {
namespace {

using whole::PoseError;

constexpr std::int16_t kUntrusted = -32768;
constexpr int kSteps = 30;
constexpr double kSlideMm = 2;
constexpr double kTwistDeg = 15;
/// Noise of one frame of sensor_a, grey levels (high-pass standard deviation).
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
    PoseError worst;
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
    std::vector<Eigen::Isometry3d> truth;
    std::vector<v1::Frame> frames;
    std::vector<std::string> sent;
    for (int step = 0; step <= kSteps; ++step) {
      const double part = static_cast<double>(step) / kSteps;
      Eigen::Isometry3d moved(Eigen::Translation3d(part * slide_mm, 0, 0));
      moved.rotate(
          Eigen::AngleAxisd(part * twist_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitZ()));
      truth.push_back(moved);
      frames.push_back(frame_of(depth(model, reference, images.reference, loss, moved), model));
      frames.back().set_sequence(static_cast<std::uint64_t>(step) + 1);
      sent.push_back(frames.back().SerializeAsString());
    }
    perceive::FrameMaker maker;
    const std::vector<whole::TrackRow> track = whole::perceive_track(sent, maker);
    Result result;
    for (std::size_t i = 0; i < track.size(); ++i) {
      if (!track[i].usable) {
        ++result.lost;
        continue;
      }
      const v1::Contact& contact = frames[i].contact();
      const PoseError error =
          whole::error_of(track[i].motion, truth[i], {contact.x_mm(), contact.y_mm(), 0},
                          std::sqrt(contact.area_mm2() / std::numbers::pi), track[i].unobservable);
      result.worst.mm = std::max(result.worst.mm, error.mm);
      result.worst.deg = std::max(result.worst.deg, error.deg);
      result.unobservable = track[i].unobservable.size();
    }
    fmt::print(
        "{} {}, {:.0f} mm {:.0f} deg, {} unobservable: worst {:.0f} um {:.2f} deg, {} lost\n",
        GetParam().name, object, slide_mm, twist_deg, result.unobservable, 1e3 * result.worst.mm,
        result.worst.deg, result.lost);
    return result;
  }

 private:
  /// The map as the daemon sends it.
  static v1::Frame frame_of(const std::vector<std::int16_t>& um, const recon::Model& model) {
    const auto width = static_cast<std::uint32_t>(model.rectify.width);
    const auto height = static_cast<std::uint32_t>(model.rectify.height);
    constexpr int kContactUm = 100;
    double sum = 0;
    double x = 0;
    double y = 0;
    double area = 0;
    int deepest = 0;
    for (std::size_t i = 0; i < um.size(); ++i) {
      if (um[i] <= kContactUm) continue;
      deepest = std::max<int>(deepest, um[i]);
      area += model.mm_per_px * model.mm_per_px;
      sum += um[i];
      const std::size_t column = i % width;
      const std::size_t row = i / width;
      x += um[i] * (static_cast<double>(column) - 0.5 * (width - 1));
      y += um[i] * (static_cast<double>(row) - 0.5 * (height - 1));
    }
    v1::Frame frame;
    v1::Contact& contact = *frame.mutable_contact();
    contact.set_in_contact(true);
    contact.set_area_mm2(area);
    contact.set_x_mm(x / sum * model.mm_per_px);
    contact.set_y_mm(y / sum * model.mm_per_px);
    contact.set_deepest_mm(1e-3 * deepest);
    v1::DepthMap& map = *frame.mutable_depth();
    map.set_encoding(v1::DEPTH_INT16);
    map.set_width(width);
    map.set_height(height);
    map.set_full_width(width);
    map.set_full_height(height);
    map.set_decimation(1);
    map.set_mm_per_px(model.mm_per_px);
    map.set_um_per_unit(1);
    map.set_untrusted_value(kUntrusted);
    constexpr double kUncertaintyUm = 30;
    map.set_uncertainty_um(kUncertaintyUm);
    map.set_data(um.data(), um.size() * sizeof(std::int16_t));
    return frame;
  }

  /// Depth of the camera's view of the darkening after `motion`.
  [[nodiscard]] std::vector<std::int16_t> depth(const recon::Model& model,
                                                const std::vector<std::uint16_t>& reference,
                                                const cv::Mat1f& light, const cv::Mat1f& loss,
                                                const Eigen::Isometry3d& motion) {
    const double middle_x = 0.5 * (loss.cols - 1);
    const double middle_y = 0.5 * (loss.rows - 1);
    const Eigen::Matrix3d turn = motion.linear();
    const Eigen::Vector3d shift = motion.translation() / model.mm_per_px;
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
      um.push_back(std::isnan(value) ? kUntrusted : static_cast<std::int16_t>(std::lround(value)));
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
    EXPECT_LT(result.worst.mm, 0.015);
    EXPECT_LT(result.worst.deg, 0.2);
  }
}

// sensor_b's asymmetric press looks as if it showed two of a ball's three rotations.
TEST_P(RealPose, ABallSlidesAndTurns) {
  for (const auto& [slide_mm, twist_deg] : {std::pair{kSlideMm, 0.0}, {0.0, kTwistDeg}}) {
    const Result result = follow("ball", slide_mm, twist_deg);
    EXPECT_EQ(result.lost, 0);
    EXPECT_LT(result.worst.mm, 0.05);
    EXPECT_LT(result.worst.deg, 2);
  }
}

// The published scales of the two sensors.
INSTANTIATE_TEST_SUITE_P(Sensors, RealPose,
                         testing::Values(Sensor{"sensor_a", 0.0510}, Sensor{"sensor_b", 0.05317}),
                         [](const auto& tested) { return std::string(tested.param.name); });

}  // namespace
}  // namespace dtact
