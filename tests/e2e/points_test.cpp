// dtact-perceive's points of the simulated sensor, compared with the pressed object.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "hal/sim/placement.hpp"
#include "hal/sim/truth.hpp"
#include "tests/e2e/press.hpp"
#include "tests/e2e/sensor.hpp"
#include "tests/fakes/perceive_server.hpp"

namespace dtact::e2e {
namespace {

TEST(Points, OfTheContactDuringContact) {
  const TempFolder folder;
  const Press press(folder);
  const Sensor sensor(press.file);
  const fakes::PerceiveServer perceive(sensor.options());
  client::Client client = perceive.connect();
  v1::Subscribe subscription;
  subscription.set_cloud(v1::CLOUD_INT16);
  subscription.set_contact_box(true);
  client.subscribe(subscription);
  int with = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr) return false;
        EXPECT_FALSE(frame->has_depth());
        EXPECT_TRUE(frame->contact().in_contact() || !frame->has_cloud());
        if (!frame->has_cloud()) return false;
        const v1::PointCloud& cloud = frame->cloud();
        EXPECT_EQ(cloud.data().size(), 12 * std::size_t{cloud.width()} * cloud.height());
        EXPECT_EQ(cloud.points(), cloud.width() * cloud.height());
        EXPECT_LT(cloud.width(), 300U) << "the contact alone";
        return ++with == 10;
      },
      std::chrono::seconds(60)));
}

/// A sensor with a curved surface, and its calibration's surface model.
struct Finger {
  const char* name;
  const char* scene;
  const char* calibration;
};
void PrintTo(const Finger& finger, std::ostream* out) { *out << finger.name; }

/// The part of the map with the contact wherever the ball is held: under the thread sanitizer
/// a whole map's points take many seconds.
constexpr std::size_t kBoxColumn = 165;
constexpr std::size_t kBoxRow = 90;
constexpr std::size_t kBoxSide = 195;

class PointsOfABall : public testing::TestWithParam<Finger> {};

/// Mean distance from the ball of the points in contact, and the median of their normals'
/// errors.
struct PointsError {
  double mm = 0;
  double degrees = 0;
};
PointsError points_error(const v1::Frame& frame, const hal::sim::Truth& truth) {
  const hal::sim::Pose pose = truth.pose(0, frame.sequence()).value();
  const cv::Vec3d middle = cv::Vec3d(pose.x_mm, pose.y_mm, pose.z_mm) +
                           hal::sim::rotation_of(pose.turn_deg) * cv::Vec3d(0, 0, kRadiusMm);
  std::vector<std::uint8_t> contact;
  truth.contact(frame.sequence(), contact);
  const auto width = static_cast<std::size_t>(truth.scene().camera.width);
  const v1::PointCloud& cloud = frame.cloud();
  const std::size_t size = std::size_t{cloud.width()} * cloud.height();
  std::vector<float> values(6 * size);
  if (cloud.width() != kBoxSide || cloud.data().size() != values.size() * sizeof(float)) {
    throw std::runtime_error("the cloud is not as large as it says");
  }
  std::memcpy(values.data(), cloud.data().data(), cloud.data().size());
  double distance = 0;
  std::vector<double> angles;
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t row = i / kBoxSide + kBoxRow + kCropRow;
    const std::size_t column = i % kBoxSide + kBoxColumn + kCropColumn;
    if (contact[row * width + column] == 0 || std::isnan(values[i])) continue;
    const cv::Vec3d point = 1e3 * cv::Vec3d(values[i], values[size + i], values[2 * size + i]);
    const cv::Vec3d normal(values[3 * size + i], values[4 * size + i], values[5 * size + i]);
    const cv::Vec3d inwards = middle - point;
    distance += std::abs(cv::norm(inwards) - kRadiusMm);
    angles.push_back(std::acos(std::clamp(normal.dot(inwards) / cv::norm(inwards), -1.0, 1.0)));
  }
  EXPECT_GT(angles.size(), 5000U);
  const auto half = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2);
  std::nth_element(angles.begin(), half, angles.end());
  return {distance / static_cast<double>(angles.size()), *half * 180 / M_PI};
}

TEST_P(PointsOfABall, LieOnIt) {
  const TempFolder folder;
  const Press press(folder, GetParam().scene);
  const hal::sim::Truth truth(press.scene);
  const std::filesystem::path calibration = folder.path() / "calibration";
  std::filesystem::copy(calibration_folder(), calibration);
  const std::filesystem::path file = calibration / "calibration.toml";
  std::string text = base::read_file(file, 1 << 20);
  text.insert(text.find('\n', text.find("\n[surface]") + 1) + 1, GetParam().calibration);
  base::write_file_atomically(file, text);
  const Sensor sensor(press.file, false,
                      {"calibration=" + calibration.string(), "reconstruction.sharpen=1"});
  const fakes::PerceiveServer perceive(sensor.options());
  client::Client client = perceive.connect();
  v1::Subscribe subscription;
  subscription.set_cloud(v1::CLOUD_FLOAT32);
  auto& box = *subscription.mutable_box();
  box.set_x(kBoxColumn);
  box.set_y(kBoxRow);
  box.set_width(kBoxSide);
  box.set_height(kBoxSide);
  client.subscribe(subscription);
  int frames = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr || !frame->has_cloud()) return false;
        const double t = press.time_s(frame->sequence());
        if (t < 4.2 || t > 7.9) return false;
        const PointsError error = points_error(*frame, truth);
        std::printf("%s: %.4f mm off, normals %.2f degrees\n", GetParam().name, error.mm,
                    error.degrees);
        EXPECT_LT(error.mm, 0.03);
        EXPECT_LT(error.degrees, 3);
        return ++frames == 5;
      },
      std::chrono::seconds(60)));
}

// A point pressed in by 1 mm appears 0.33 mm farther out, 8 mm beside the axis of a camera that is
// 25 mm above.
TEST(Points, OfABallBesideTheAxisLieOnItWhereItIs) {
  constexpr double kX = -6.6;
  constexpr double kY = 4.5;
  constexpr std::uint64_t kHeld = 252;  // 4.2 s: the ball is at rest
  const TempFolder folder;
  const std::filesystem::path scene_file = folder.path() / "beside.toml";
  base::write_file_atomically(scene_file, fmt::format(R"([surface]
camera_mm = 25.0
[[press]]
object = "ball"
radius_mm = 4.0
keys = [ {{ t = 3.0, x = {}, y = {}, depth = -0.3 }}, {{ t = 4.0, depth = 1.0 }} ]
)",
                                                      kX, kY));
  const std::filesystem::path calibration = folder.path() / "calibration";
  std::filesystem::copy(calibration_folder(), calibration);
  const std::filesystem::path file = calibration / "calibration.toml";
  std::string text = base::read_file(file, 1 << 20);
  const std::size_t height = text.find("\nper_mm = ") + 1;
  text.replace(height, text.find(' ', height + 9) - height, "per_mm = 0.04");
  base::write_file_atomically(file, text);
  const Sensor sensor(scene_file, false, {"calibration=" + calibration.string()});
  const fakes::PerceiveServer perceive(sensor.options());
  client::Client client = perceive.connect();
  v1::Subscribe subscription;
  subscription.set_cloud(v1::CLOUD_FLOAT32);
  subscription.set_contact_box(true);
  client.subscribe(subscription);
  int frames = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr || !frame->has_cloud() || frame->sequence() < kHeld) {
          return false;
        }
        const v1::Contact& contact = frame->contact();
        EXPECT_NEAR(contact.x_mm(), kX, 0.02);
        EXPECT_NEAR(contact.y_mm(), kY, 0.02);
        const std::size_t size = std::size_t{frame->cloud().width()} * frame->cloud().height();
        std::vector<float> values(6 * size);
        EXPECT_EQ(frame->cloud().data().size(), values.size() * sizeof(float));
        std::memcpy(values.data(), frame->cloud().data().data(), values.size() * sizeof(float));
        double distance = 0;
        int points = 0;
        for (std::size_t i = 0; i < size; ++i) {
          const cv::Vec3d point =
              1e3 * cv::Vec3d(values[i], values[size + i], values[2 * size + i]);
          const cv::Vec3d from_middle = point - cv::Vec3d(kX, kY, 3);
          // Inside of the contact, which is 2.6 mm wide.
          if (!(std::hypot(from_middle[0], from_middle[1]) < 2)) continue;
          distance += std::abs(cv::norm(from_middle) - 4);
          ++points;
        }
        EXPECT_GT(points, 5000);
        std::printf("contact at %.4f, %.4f; points %.4f mm off\n", contact.x_mm(), contact.y_mm(),
                    distance / points);
        EXPECT_LT(distance / points, 0.012);
        return ++frames == 5;
      },
      std::chrono::seconds(60)));
}

INSTANTIATE_TEST_SUITE_P(
    Surfaces, PointsOfABall,
    testing::Values(
        Finger{"plane", "", ""},
        Finger{"sphere", "[surface]\nshape = \"sphere\"\nradius_mm = 30.0\ncamera_mm = 28.0\n\n",
               "shape = \"sphere\"\nradius_mm = 30\nair_mm = 20\ngel_mm = 8\n"
               "refraction = 1\n"},
        Finger{"cylinder",
               "[surface]\nshape = \"cylinder\"\nradius_mm = 30.0\ncamera_mm = 28.0\n\n",
               "shape = \"cylinder\"\nradius_mm = 30\naxis_deg = 0\nair_mm = 20\n"
               "gel_mm = 8\nrefraction = 1\n"}),
    [](const auto& tested) { return std::string(tested.param.name); });

}  // namespace
}  // namespace dtact::e2e
