// The guided calibration with piped input, on a scene in which a ball is pressed repeatedly, and
// the error of the depth that the calibration measures then.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <regex>

#include "hal/base/atomic_file.hpp"
#include "hal/sim/scene.hpp"
#include "tests/e2e/depth_error.hpp"
#include "tests/e2e/patience.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// Exit codes of the programs (clients/common/exit_codes.hpp).
constexpr int kDone = 0;
constexpr int kFailed = 1;
constexpr int kNoConnection = 3;
constexpr int kNotMet = 4;

std::string enters(int count) { return std::string(static_cast<std::size_t>(count), '\n'); }

/// Runs `dtact-calibrate guided` in the sensor's folder with these lines typed.
int guide(const Sensor& sensor, const std::string& typed, std::string* output,
          const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments = {CALIBRATE_PROGRAM,
                                        "--port",
                                        std::to_string(sensor.daemon->port()),
                                        "guided",
                                        "--radius-mm",
                                        "4.0",
                                        "--mm-per-px",
                                        "0.0413793",
                                        "--centre",
                                        "400,300",
                                        "--crop",
                                        kCrop,
                                        "--folder",
                                        (sensor.folder.path() / "ball").string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_program(arguments, output, typed);
}

bool there(const Sensor& sensor, const std::string& name) {
  return fs::exists(sensor.folder.path() / "ball" / name);
}

std::string rate() { return fmt::format("camera.fps={}", kFps); }

/// The presses of calibration_presses.toml, each held as long as the machine needs.
fs::path presses(const TempFolder& folder) {
  std::ifstream file(scene_file("calibration_presses.toml"));
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::regex time("\\b(t|from_s|to_s) = ([0-9.]+)");
  std::string slower;
  auto rest = text.cbegin();
  for (auto at = std::sregex_iterator(rest, text.cend(), time); at != std::sregex_iterator();
       ++at) {
    slower.append(rest, (*at)[2].first);
    slower += fmt::format("{}", kSlower * std::stod((*at)[2]));
    rest = (*at)[2].second;
  }
  slower.append(rest, text.cend());
  fs::path scene = folder.path() / "scene.toml";
  base::write_file_atomically(scene, slower);
  return scene;
}

TEST(Guided, FromNothingToACalibrationThatMeasuresAnotherBall) {
  const TempFolder folder;
  Sensor sensor(presses(folder), false, {rate()});
  std::string output;
  // More than needed: a press may be too light, or one of its depth may have been taken.
  ASSERT_EQ(guide(sensor, enters(60), &output), kDone) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("Step 1 of 3"), HasSubstr("press-06 taken"),
                            HasSubstr("the daemon uses calibration ball from now on")));
  EXPECT_TRUE(there(sensor, "preview.png"));

  // Another ball, of 5 mm, which the calibration has not seen.
  const std::string scene = "camera.sim.scene=";
  for (std::string& argument : sensor.arguments) {
    if (argument.starts_with(scene)) argument = scene;
  }
  sensor.restart();
  client::Client client = sensor.connect();
  client.subscribe();
  const hal::sim::Truth truth(hal::sim::at_mode(hal::sim::default_scene(), 800, 600, kFps));
  std::vector<double> inside;
  double worst_no_contact = 0;
  int no_contact = 0;
  std::uint64_t judged = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr || !frame->has_depth()) return false;
        EXPECT_FALSE(has(frame->health(), v1::HEALTH_CAMERA_MISMATCH));
        EXPECT_FALSE(has(frame->health(), v1::HEALTH_LIGHT_MISMATCH));
        // In the scene's loop of twelve seconds this is its ball, not the nut. Six frames a second.
        const std::uint64_t place = frame->sequence() % (12 * kFps);
        if (4 * place > 23 * kFps || frame->sequence() < judged + kFps / 6) return false;
        judged = frame->sequence();
        const DepthError error = depth_error(*frame, truth);
        if (error.inside_pixels > 5000) {
          inside.push_back(error.inside_mm);
        } else if (error.inside_pixels == 0) {
          worst_no_contact = std::max(worst_no_contact, error.outside_mm);
          ++no_contact;
        }
        return inside.size() >= 10 && no_contact >= 5;
      },
      std::chrono::seconds(120)));
  const double worst = *std::max_element(inside.begin(), inside.end());
  std::sort(inside.begin(), inside.end());
  std::printf(
      "ball of 5 mm, simulated sensor, guided calibration with 6 presses of a 4 mm ball: mean "
      "absolute error inside the true contact %.4f mm (median of %zu frames), worst frame %.4f mm; "
      "without contact %.4f mm at most (%d frames)\n",
      inside[inside.size() / 2], inside.size(), worst, worst_no_contact, no_contact);
  EXPECT_LE(worst, 0.05);
  EXPECT_LE(worst_no_contact, 0.01);
}

TEST(Guided, QuitRetakeAndGoOn) {
  const TempFolder folder;
  const Sensor sensor(presses(folder), false, {rate()});
  std::string output;
  EXPECT_EQ(guide(sensor, "\n\n\nr\nq\n", &output), kNotMet) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("[r] retake press-02"),
                            HasSubstr("To continue: dtact-calibrate --port "),
                            HasSubstr(" guided --radius-mm 4.0 ")));
  EXPECT_TRUE(there(sensor, "reference/sensor.toml"));
  EXPECT_TRUE(there(sensor, "press-02/15.png"));
  EXPECT_FALSE(there(sensor, "press-03"));

  EXPECT_EQ(guide(sensor, "\n\n", &output), kNotMet) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("2 press(es) are there"), HasSubstr("The input ended")));
  EXPECT_TRUE(there(sensor, "press-03"));

  ASSERT_EQ(run_program({DTACTCTL_PROGRAM, "--port", std::to_string(sensor.daemon->port()), "led",
                         "--brightness", "100"},
                        &output),
            kDone);
  EXPECT_EQ(guide(sensor, "\n\n", &output), kFailed) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("LED 0 shows 100 100 100 but showed 255 255 255"),
                            HasSubstr("dtactctl led")));
}

TEST(Guided, SaysWhatIsNotFit) {
  Sensor sensor({}, false, {"ring.brightness=10"});
  std::string output;
  EXPECT_EQ(guide(sensor, "\n", &output), kNotMet) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("too dark"), HasSubstr("dtactctl led")));
  EXPECT_FALSE(there(sensor, "reference"));
  const std::uint16_t port = sensor.daemon->port();
  EXPECT_EQ(sensor.daemon->stop(SIGTERM), 0);
  EXPECT_EQ(run_program({CALIBRATE_PROGRAM, "--port", std::to_string(port), "guided", "--radius-mm",
                         "4", "--mm-per-px", "0.05"},
                        &output),
            kNoConnection);
  EXPECT_THAT(output, HasSubstr("dtactd"));
}

TEST(Guided, RefusesACameraThatIsAway) {
  const TempFolder folder;
  const fs::path scene = folder.path() / "unplugged.toml";
  std::ofstream(scene) << "[[fault]]\nkind = \"unplug\"\nframe = 60\nframes = 1000000\n";
  const Sensor away(scene, false);
  client::Client client = away.connect();
  ASSERT_TRUE(read_until(client, [](const Item& item) {
    const auto* event = std::get_if<v1::Event>(&item);
    return event != nullptr && event->state().state() == v1::STATE_CAMERA_LOST;
  }));
  std::string output;
  EXPECT_EQ(guide(away, "\n", &output), kFailed) << output;
  EXPECT_THAT(output, HasSubstr("not fit to be calibrated"));
}

}  // namespace
}  // namespace dtact::e2e
