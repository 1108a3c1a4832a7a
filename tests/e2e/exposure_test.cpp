// A camera with automatic exposure, and the time that a light change takes.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>

#include "hal/base/atomic_file.hpp"
#include "tests/e2e/patience.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

using testing::HasSubstr;

std::filesystem::path write_scene(const TempFolder& folder, const std::string& text) {
  std::filesystem::path file = folder.path() / "scene.toml";
  base::write_file_atomically(file, text);
  return file;
}

/// An exposure that follows the picture, and an object that covers a part of the picture for five
/// seconds of every ten, with sanitizers longer. The daemon must see the picture uncovered first,
/// however late it starts.
std::string covered_again_and_again() {
  std::string text = "[[fault]]\nkind = \"auto_exposure\"\nframe = 0\nframes = 100000\n";
  constexpr int kFrames = 300 * kSlower;
  for (int frame = kFrames; frame < 100000; frame += 2 * kFrames) {
    text += fmt::format("[[fault]]\nkind = \"covered\"\nframe = {}\nframes = {}\n", frame, kFrames);
  }
  return text;
}

TEST(Exposure, ThatFollowsThePictureIsNamedThoughTheCameraCallsItLocked) {
  const TempFolder folder;
  const Sensor sensor(write_scene(folder, covered_again_and_again()));
  client::Client client = sensor.connect();
  v1::Subscribe summary;
  summary.set_summary(true);
  client.subscribe(summary);
  // The status has a frame's health flags by the time of the next frame.
  int frames = 0;
  ASSERT_TRUE(read_until(client, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && has(frame->health(), v1::HEALTH_EXPOSURE_UNLOCKED) && ++frames == 2;
  }));
  const v1::Status status = client.status();
  EXPECT_TRUE(status.camera().controls(0).locked());
  EXPECT_THAT(status.advice(), HasSubstr("exposure or gain runs automatically"));
}

/// A small picture at a rate that any machine keeps up with.
std::vector<std::string> small_mode() {
  return {"camera.width=160", "camera.height=120", "camera.fps=30", "camera.sim.output=luma",
          "ring.brightness=200"};
}

TEST(LightDelay, IsMeasuredAndTheLightIsAsBefore) {
  const TempFolder folder;
  // Complete in the sixth frame whose exposure begins after the change, or in the one before if the
  // device had not begun that frame: five show the old light.
  const Sensor sensor(write_scene(folder, "[camera]\nlight_delay_frames = 6\n"), false,
                      small_mode());
  const std::string port = std::to_string(sensor.daemon->port());
  std::string output;
  ASSERT_EQ(run_program({DTACTCTL_PROGRAM, "--port", port, "led", "--measure"}, &output), 0)
      << output;
  EXPECT_THAT(output, HasSubstr("darker    median 5, worst "));
  EXPECT_THAT(output, HasSubstr("brighter  median 5, worst "));
  EXPECT_THAT(output, HasSubstr("[camera]\nlight_delay_frames = "));
  EXPECT_EQ(sensor.connect().status().light().brightness(), 200U);
}

TEST(LightDelay, LeavesTheLightAsItWasWhenInterrupted) {
  const Sensor sensor({}, false, small_mode());
  client::Client client = sensor.connect();
  const std::string port = std::to_string(sensor.daemon->port());
  const pid_t child = ::fork();
  if (child == 0) {
    ::execl(DTACTCTL_PROGRAM, DTACTCTL_PROGRAM, "--port", port.c_str(), "led", "--measure",
            nullptr);
    ::_exit(127);
  }
  EXPECT_TRUE(read_until(client, [](const Item& item) {
    const auto* event = std::get_if<v1::Event>(&item);
    return event != nullptr && event->has_light() && event->light().brightness() == 100;
  }));
  ::kill(child, SIGINT);
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1);
  EXPECT_EQ(client.status().light().brightness(), 200U);
}

TEST(LightDelay, SaysWhyItCannotBeMeasured) {
  for (const auto& [setting, sentence] :
       {std::pair{"ring.backend=null", "set ring.backend"},
        std::pair{"camera.backend=null", "is this the camera that looks at the ring"}}) {
    std::vector<std::string> settings = small_mode();
    settings.emplace_back(setting);
    const Sensor sensor({}, false, settings);
    const std::string port = std::to_string(sensor.daemon->port());
    std::string output;
    EXPECT_EQ(run_program({DTACTCTL_PROGRAM, "--port", port, "led", "--measure"}, &output), 1);
    EXPECT_THAT(output, HasSubstr(sentence)) << setting;
    EXPECT_EQ(sensor.connect().status().light().brightness(), 200U) << setting;
  }
}

}  // namespace
}  // namespace dtact::e2e
