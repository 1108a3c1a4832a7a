// `dtact-perceive serve --object` beside a daemon on the simulated sensor, compared with the
// pressed object.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <opencv2/core/matx.hpp>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "tests/e2e/patience.hpp"
#include "tests/e2e/press.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

/// The program `dtact-perceive serve` beside a sensor's daemon.
class PerceiveProgram {
 public:
  PerceiveProgram(const Sensor& sensor, const std::vector<std::string>& arguments)
      : program_(command(sensor, arguments)) {
    const auto deadline = std::chrono::steady_clock::now() + kSlower * std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < deadline) {
      const std::string log = program_.log();
      std::smatch said;
      if (std::regex_search(log, said, std::regex("listening on 127\\.0\\.0\\.1:([0-9]+)"))) {
        port_ = static_cast<std::uint16_t>(std::stoi(said[1]));
        return;
      }
      if (program_.ended()) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    throw std::runtime_error("dtact-perceive does not serve:\n" + program_.log());
  }

  [[nodiscard]] client::Client connect() const {
    client::Options options;
    options.port = port_;
    return client::Client(options);
  }
  [[nodiscard]] std::string log() const { return program_.log(); }
  int stop() { return program_.stop(SIGTERM); }

 private:
  static std::vector<std::string> command(const Sensor& sensor,
                                          const std::vector<std::string>& arguments) {
    std::vector<std::string> all{
        PERCEIVE_PROGRAM, "--port",        std::to_string(sensor.daemon->port()),
        "serve",          "--listen-port", "0"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return all;
  }

  Program program_;
  std::uint16_t port_ = 0;
};

/// A ball about its file's origin, millimetres, as an STL file's text: its facets are within 5 µm
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

TEST(KnownObject, IsFoundAndFollowedByTheProgram) {
  const TempFolder folder;
  const Press press(folder);
  const Sensor sensor(press.file);
  const std::filesystem::path file = folder.path() / "known_ball.stl";
  base::write_file_atomically(file, stl_of_a_ball(kRadiusMm));
  PerceiveProgram perceive(sensor, {"--object", file.string(), "--object-unit", "mm"});
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
        const double t = press.time_s(frame->sequence());
        // The ball is pressed in, held and slid.
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
  EXPECT_EQ(perceive.stop(), 0);
}

TEST(KnownObject, SaysWhatIsWrongWithItsFile) {
  const TempFolder folder;
  const auto reported = [&folder](const std::string& text, const std::string& unit = "mm") {
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
  EXPECT_THAT(reported(text, "m"), testing::HasSubstr("is its unit another one?"));
  text.resize(text.size() / 2);
  EXPECT_THAT(reported(text), testing::HasSubstr("line "));
}

TEST(KnownObject, IsDoubtedWhenItIsLarge) {
  const TempFolder folder;
  const Sensor sensor;
  const std::filesystem::path file = folder.path() / "large.stl";
  base::write_file_atomically(file, stl_of_a_ball(25));
  const PerceiveProgram perceive(sensor, {"--object", file.string(), "--object-unit", "mm"});
  EXPECT_THAT(perceive.log(), testing::HasSubstr("give only the part in contact"));
}

}  // namespace
}  // namespace dtact::e2e
