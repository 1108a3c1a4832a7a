// dtact-perceive beside a daemon on the simulated sensor, against what was pressed in.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "clients/perceive/object_file.hpp"
#include "clients/perceive/server.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/sim/placement.hpp"
#include "hal/sim/scene.hpp"
#include "hal/sim/truth.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

/// A server of the test's own, on a thread.
class Perceive {
 public:
  /// `object`: whose place poses are.
  explicit Perceive(const Sensor& sensor,
                    const std::shared_ptr<const perceive::ObjectModel>& object = nullptr) {
    client::Options daemon;
    daemon.port = sensor.daemon->port();
    net::NetConfig config;
    config.port = 0;
    config.features = wire::kPerceiveFeatures;
    server_ = std::make_shared<perceive::Server>(io_, config, daemon, object);
    server_->start();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~Perceive() {
    boost::asio::post(io_, [this] { server_->stop(); });
    thread_.join();
  }
  Perceive(const Perceive&) = delete;
  Perceive& operator=(const Perceive&) = delete;

  [[nodiscard]] client::Client connect() const {
    client::Options options;
    options.port = server_->port();
    return client::Client(options);
  }

 private:
  boost::asio::io_context io_;
  std::shared_ptr<perceive::Server> server_;
  std::thread thread_;
};

constexpr double kRadiusMm = 4;

// A ball goes in over a second, is held for five, and then slides by a millimetre, again and again.
constexpr const char* kScene = R"([loop]
from_s = 2.0
to_s = 14.0

[[press]]
object = "ball"
radius_mm = 4.0
keys = [
  { t = 3.0, x = 0.5, y = -0.5, depth = -0.3 },
  { t = 4.0, depth = 1.0 },
  { t = 8.0 },
  { t = 10.0, x = 1.5 },
  { t = 12.0 },
  { t = 13.0, depth = -0.3 },
]
)";

struct Press {
  /// `surface`: lines of a scene before the rest.
  explicit Press(const TempFolder& folder, const std::string& surface = "")
      : file(folder.path() / "ball.toml") {
    base::write_file_atomically(file, surface + kScene);
    scene = hal::sim::load_scene(file);
  }
  /// The ball's middle at a frame, millimetres.
  [[nodiscard]] std::array<double, 3> middle(std::uint64_t sequence) const {
    const double t = scene.time_s(sequence);
    const auto& keys = scene.presses.at(0).keys;
    const auto next =
        std::find_if(keys.begin(), keys.end(), [t](const auto& key) { return key.time_s > t; });
    const auto& a = next == keys.begin() ? keys.front() : *(next - 1);
    const auto& b = next == keys.end() ? a : *next;
    const double part = b.time_s > a.time_s ? (t - a.time_s) / (b.time_s - a.time_s) : 0;
    return {a.x_mm + part * (b.x_mm - a.x_mm), a.y_mm + part * (b.y_mm - a.y_mm),
            kRadiusMm - a.depth_mm - part * (b.depth_mm - a.depth_mm)};
  }

  std::filesystem::path file;
  hal::sim::Scene scene;
};

TEST(Perceive, FollowsASlidingBallWithoutItsRotation) {
  const TempFolder folder;
  const Press press(folder);
  const Sensor sensor(press.file);
  const Perceive perceive(sensor);
  client::Client client = perceive.connect();
  v1::Subscribe subscription;
  subscription.set_pose(true);
  client.subscribe(subscription);
  std::uint64_t since = 0;
  std::vector<double> slide_um;
  double turned = 0;
  int tracked = 0;
  int others = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr || !frame->has_pose()) return false;
        const v1::ObjectPose& pose = frame->pose();
        if (pose.tracking() == v1::ObjectPose::STARTED) since = frame->sequence();
        if (since == 0 || pose.since_sequence() != since) return false;
        // The slide, from where it was held on.
        const double t = press.scene.time_s(frame->sequence());
        if (t < 4.2 || t > 11.9) return false;
        ++(pose.tracking() == v1::ObjectPose::TRACKED ? tracked : others);
        const auto now = press.middle(frame->sequence());
        const auto then = press.middle(since);
        const double error = std::hypot(pose.translation_mm().x() - (now[0] - then[0]),
                                        pose.translation_mm().y() - (now[1] - then[1]));
        EXPECT_FALSE(frame->has_depth());
        if (t > 10.2) {
          slide_um.push_back(1000 * error);
          turned = std::max(turned, std::hypot(pose.rotation_deg().x(), pose.rotation_deg().y(),
                                               pose.rotation_deg().z()));
          EXPECT_EQ(pose.unobservable_size(), 3);
        }
        return t > 11.5 && slide_um.size() > 10;
      },
      std::chrono::seconds(60)));
  const double worst_um = *std::max_element(slide_um.begin(), slide_um.end());
  std::printf(
      "a ball slid by 1 mm: at most %.0f um off, turned by %.2f degrees; %d frames tracked, %d "
      "not\n",
      worst_um, turned, tracked, others);
  EXPECT_LT(worst_um, 200);
  EXPECT_LT(turned, 0.5);
  EXPECT_LT(others, tracked / 20 + 1);
}

/// A ball about its file's origin, millimetres, as an STL file's text: its facets lie within 5 µm
/// of it.
std::string stl_of_a_ball(double radius) {
  constexpr int kRings = 48;
  constexpr int kSectors = 96;
  const auto point = [radius](int ring, int sector) {
    const double from_pole = M_PI * ring / kRings;
    const double round = 2 * M_PI * (sector % kSectors) / kSectors;
    return cv::Vec3d(radius * std::sin(from_pole) * std::cos(round),
                     radius * std::sin(from_pole) * std::sin(round), radius * std::cos(from_pole));
  };
  std::ostringstream text;
  const auto facet = [&text](const cv::Vec3d& a, const cv::Vec3d& b, const cv::Vec3d& c) {
    text << "facet normal 0 0 0\nouter loop\n";
    for (const cv::Vec3d& one : {a, b, c}) {
      text << "vertex " << one[0] << ' ' << one[1] << ' ' << one[2] << '\n';
    }
    text << "endloop\nendfacet\n";
  };
  text << "solid ball\n";
  for (int ring = 0; ring < kRings; ++ring) {
    for (int sector = 0; sector < kSectors; ++sector) {
      facet(point(ring, sector), point(ring + 1, sector), point(ring + 1, sector + 1));
      facet(point(ring, sector), point(ring + 1, sector + 1), point(ring, sector + 1));
    }
  }
  text << "endsolid ball\n";
  return text.str();
}

TEST(Perceive, SaysWhereAKnownBallIs) {
  const TempFolder folder;
  const Press press(folder);
  const Sensor sensor(press.file);
  const std::filesystem::path file = folder.path() / "known_ball.stl";
  base::write_file_atomically(file, stl_of_a_ball(kRadiusMm));
  const Perceive perceive(sensor, perceive::load_object(file, "mm"));
  client::Client client = perceive.connect();
  v1::Subscribe subscription;
  subscription.set_pose(true);
  client.subscribe(subscription);
  double worst_mm = 0;
  int tracked = 0;
  int others = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr || !frame->has_pose()) return false;
        const v1::ObjectPose& pose = frame->pose();
        EXPECT_EQ(pose.object(), "known_ball");
        const double t = press.scene.time_s(frame->sequence());
        // Pressed in, held and slid.
        if (t < 4.2 || t > 11.9 || pose.tracking() == v1::ObjectPose::SEARCHING) return false;
        if (pose.tracking() != v1::ObjectPose::TRACKED) {
          ++others;
          return false;
        }
        const auto truth = press.middle(frame->sequence());
        worst_mm = std::max(worst_mm, std::hypot(pose.translation_mm().x() - truth[0],
                                                 pose.translation_mm().y() - truth[1],
                                                 pose.translation_mm().z() - truth[2]));
        EXPECT_EQ(pose.unobservable_size(), 3) << "a ball's turns";
        EXPECT_EQ(pose.alternatives(), 0U);
        return ++tracked >= 30 && t > 10.2;
      },
      std::chrono::seconds(90)));
  std::printf("a known ball: at most %.3f mm off in %d frames; %d frames not tracked\n", worst_mm,
              tracked, others);
  EXPECT_LT(worst_mm, 0.3);
  EXPECT_LT(others, tracked / 20 + 3);
}

TEST(Perceive, SaysWhatIsWrongWithAnObjectsFile) {
  const TempFolder folder;
  const auto told = [&folder](const std::string& text, const std::string& unit = "mm") {
    const std::filesystem::path file = folder.path() / "object.stl";
    base::write_file_atomically(file, text);
    std::string output;
    EXPECT_EQ(run_program({PERCEIVE_PROGRAM, "serve", "--listen-port", "0", "--object",
                           file.string(), "--object-unit", unit},
                          &output),
              1);
    EXPECT_THAT(output, testing::HasSubstr(file.string()));
    return output;
  };
  std::string text = stl_of_a_ball(kRadiusMm);
  EXPECT_THAT(told(text, "m"), testing::HasSubstr("is its unit another one?"));
  text.resize(text.size() / 2);
  EXPECT_THAT(told(text), testing::HasSubstr("line "));
}

TEST(Perceive, PointsOfTheContactWhileSomethingTouches) {
  const TempFolder folder;
  const Press press(folder);
  const Sensor sensor(press.file);
  const Perceive perceive(sensor);
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
        EXPECT_TRUE(frame->contact().touching() || !frame->has_cloud());
        if (!frame->has_cloud()) return false;
        const v1::PointCloud& cloud = frame->cloud();
        EXPECT_EQ(cloud.data().size(), 12 * std::size_t{cloud.width()} * cloud.height());
        EXPECT_EQ(cloud.points(), cloud.width() * cloud.height());
        EXPECT_LT(cloud.width(), 300U) << "the contact alone";
        return ++with == 10;
      },
      std::chrono::seconds(60)));
}

/// A sensor whose surface is curved, and what its calibration says of that.
struct Finger {
  const char* name;
  const char* scene;
  const char* calibration;
};
void PrintTo(const Finger& finger, std::ostream* out) { *out << finger.name; }

/// The part of the map that holds the contact wherever the ball is held: where threads are watched,
/// a whole map's points take many seconds.
constexpr std::size_t kBoxColumn = 205;
constexpr std::size_t kBoxRow = 180;
constexpr std::size_t kBoxSide = 195;

class PointsOfABall : public testing::TestWithParam<Finger> {};

/// Mean distance of the points that touch from the ball, and the middle one of their normals'
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
  std::filesystem::copy(calibration_folder("model"), calibration);
  const std::filesystem::path file = calibration / "calibration.toml";
  std::string text = base::read_file(file, 1 << 20);
  text.insert(text.find('\n', text.find("\n[surface]") + 1) + 1, GetParam().calibration);
  base::write_file_atomically(file, text);
  const Sensor sensor(press.file, false,
                      {"calibration=" + calibration.string(), "reconstruction.sharpen=1"});
  const Perceive perceive(sensor);
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
        const double t = press.scene.time_s(frame->sequence());
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

TEST(Perceive, RefusesWhatTheDaemonServesAndIsRefusedItsOwnThere) {
  const Sensor sensor;
  const Perceive perceive(sensor);
  client::Client client = perceive.connect();
  EXPECT_TRUE(client.has_feature("cloud"));
  EXPECT_THROW(client.subscribe(), client::Refused);
  EXPECT_THROW((void)client.calibration(), client::Refused);
  EXPECT_GT(client.ping().monotonic_ns(), 0);
  EXPECT_EQ(client.status().clients_size(), 1);
  v1::Subscribe points;
  points.set_cloud(v1::CLOUD_INT16);
  client::Client daemon = sensor.connect();
  EXPECT_THROW(daemon.subscribe(points), client::Refused);
}

TEST(Perceive, AsksTheDaemonForNothingThatNobodyWants) {
  const Sensor sensor;
  const Perceive perceive(sensor);
  client::Client client = perceive.connect();
  client::Client daemon = sensor.connect();
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const auto sent = [&] {
    std::uint64_t all = 0;
    const v1::Status status = daemon.status();
    for (const auto& one : status.clients()) all += one.sent();
    return all;
  };
  EXPECT_EQ(sent(), 0U);
  v1::Subscribe summary;
  summary.set_summary(true);
  client.subscribe(summary);
  ASSERT_TRUE(
      read_until(client, [](const Item& item) { return std::holds_alternative<v1::Frame>(item); }));
  EXPECT_GT(sent(), 0U);
}

}  // namespace
}  // namespace dtact::e2e
