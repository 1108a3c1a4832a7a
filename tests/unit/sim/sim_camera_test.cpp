#include "hal/sim/sim_camera.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/base/clock.hpp"
#include "hal/sim/renderer.hpp"
#include "hal/sim/sim_ring.hpp"
#include "tests/unit/sim/small_scene.hpp"

namespace dtact::hal::sim {
namespace {

using namespace std::chrono_literals;

class SimCameraTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("dtact_sim_camera_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  CameraConfig config(const std::string& rest, const std::string& output, bool paced = false) {
    const auto file = folder_ / "scene.toml";
    base::write_file_atomically(file, kSmallSensor + rest);
    CameraConfig config;
    config.width = 160;
    config.height = 120;
    config.fps = 100;
    config.sim.scene = file;
    config.sim.output = output;
    config.sim.paced = paced;
    return config;
  }

  static std::vector<std::uint8_t> pixels(const Frame& frame) {
    std::vector<std::uint8_t> out;
    for (int y = 0; y < frame.luma().height; ++y) {
      out.insert(out.end(), frame.luma().row(y), frame.luma().row(y) + frame.luma().width);
    }
    return out;
  }

  static double mean_grey(const Frame& frame) {
    double sum = 0;
    for (const std::uint8_t p : pixels(frame)) sum += p;
    return sum / (160 * 120);
  }

  std::filesystem::path folder_;
  std::shared_ptr<LightLink> link_ = std::make_shared<LightLink>();
};

TEST_F(SimCameraTest, LumaIsTheRenderersFrame) {
  const CameraConfig settings = config(kBallPress, "luma");
  SimCamera camera(settings, link_);
  camera.start();
  Frame frame;
  const Scene scene = at_mode(load_scene(settings.sim.scene), 160, 120, 100);
  for (std::uint64_t n = 0; n < 3; ++n) {
    ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
    EXPECT_EQ(frame.info().sequence, n);
    EXPECT_EQ(pixels(frame), render_frame(scene, n, {}, 1).pixels);
  }
  EXPECT_EQ(camera.report().delivered, 3U);
}

TEST_F(SimCameraTest, EveryOutputDecodesToNearlyTheSameLuma) {
  SimCamera luma(config("", "luma"), link_);
  SimCamera yuyv(config("", "yuyv"), link_);
  SimCamera mjpeg(config("", "mjpeg"), link_);
  Frame a;
  Frame b;
  Frame c;
  ASSERT_EQ(luma.grab(a, 0s), GrabStatus::ok);
  ASSERT_EQ(yuyv.grab(b, 0s), GrabStatus::ok);
  ASSERT_EQ(mjpeg.grab(c, 0s), GrabStatus::ok);
  const auto expected = pixels(a);
  const auto limited = pixels(b);
  const auto compressed = pixels(c);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_NEAR(limited[i], expected[i], 1);
    ASSERT_NEAR(compressed[i], expected[i], 8);
  }
  EXPECT_NEAR(mean_grey(c), mean_grey(a), 0.1);
  EXPECT_TRUE(a.jpeg().empty());
  EXPECT_TRUE(b.jpeg().empty());
  ASSERT_GT(c.jpeg().size(), 4U);
  EXPECT_EQ(c.jpeg()[0], 0xff);
  EXPECT_EQ(c.jpeg()[1], 0xd8);
  EXPECT_EQ(luma.info().pixel_format, "GREY");
  EXPECT_EQ(yuyv.info().pixel_format, "YUYV");
  EXPECT_EQ(mjpeg.info().pixel_format, "MJPEG");
  EXPECT_GE(c.info().decode_ns, 0);
}

TEST_F(SimCameraTest, JpegsAreDecodedAtHalfTheSize) {
  CameraConfig half = config("", "mjpeg");
  half.decode_scale = 2;
  SimCamera camera(half, link_);
  EXPECT_EQ(camera.info().width, 80);
  EXPECT_EQ(camera.info().height, 60);
  EXPECT_EQ(camera.info().decode_scale, 2);
  SimCamera whole(config("", "mjpeg"), link_);
  Frame frame;
  Frame full;
  ASSERT_EQ(camera.grab(frame, 1s), GrabStatus::ok);
  ASSERT_EQ(whole.grab(full, 1s), GrabStatus::ok);
  ASSERT_EQ(frame.luma().width, 80);
  ASSERT_EQ(frame.luma().height, 60);
  EXPECT_TRUE(std::ranges::equal(frame.jpeg(), full.jpeg()));
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) {
      const std::uint8_t* const upper = full.luma().row(2 * y) + 2 * x;
      const std::uint8_t* const lower = full.luma().row(2 * y + 1) + 2 * x;
      const double mean = (upper[0] + upper[1] + lower[0] + lower[1]) / 4.0;
      ASSERT_NEAR(frame.luma().row(y)[x], mean, 6) << x << ", " << y;
    }
  }
}

TEST_F(SimCameraTest, RawFramesAreNotDecodedAtASmallerSize) {
  CameraConfig half = config("", "yuyv");
  half.decode_scale = 2;
  EXPECT_THAT(
      [&] { const SimCamera camera(half, link_); },
      testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("the frames are YUYV")));
}

TEST_F(SimCameraTest, OddSizesAreWholePictures) {
  CameraConfig settings = config("", "mjpeg");
  settings.width = 150;
  settings.height = 101;
  SimCamera camera(settings, link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_EQ(frame.luma().width, 150);
  EXPECT_EQ(frame.luma().height, 101);
  EXPECT_NEAR(frame.luma().row(100)[149], frame.luma().row(99)[148], 10);
}

TEST_F(SimCameraTest, ReadsBeyondTheLastPixelAreAllowed) {
  SimCamera camera(config("", "mjpeg"), link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  const std::uint8_t* const end = frame.luma().row(119) + 160;
  unsigned sum = 0;
  for (std::size_t i = 0; i < kLumaPadding; ++i) sum += end[i];  // an address error under ASan
  EXPECT_LE(sum, 255U * kLumaPadding);
}

TEST_F(SimCameraTest, RingChangesTheLightAfterItsDelay) {
  SimRing ring(link_);
  SimCamera camera(config("", "luma"), link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_LT(mean_grey(frame), 2);  // dark after power-on

  ASSERT_TRUE(ring.show({}).ok);
  for (int i = 0; i < camera.info().light_delay_frames; ++i) {
    ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  }
  const double full = mean_grey(frame);
  EXPECT_GT(full, 120);
  Light half;
  half.brightness = 127;
  ASSERT_TRUE(ring.show(half).ok);
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_NEAR(mean_grey(frame) / full, 0.75, 0.01);  // half of the exposure
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_NEAR(mean_grey(frame) / full, 0.498, 0.005);
}

TEST_F(SimCameraTest, WithoutARingTheLightIsFull) {
  SimCamera camera(config("", "luma"), link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_GT(mean_grey(frame), 120);
}

std::string fault(const std::string& kind, int first, int count = 1) {
  return "[[fault]]\nkind = \"" + kind + "\"\nframe = " + std::to_string(first) +
         "\nframes = " + std::to_string(count) + "\n";
}

TEST_F(SimCameraTest, DroppedFramesAreAGapAndMarked) {
  SimCamera camera(config(fault("drop", 1, 2), "luma"), link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_EQ(frame.info().flags, kFrameNormal);
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_EQ(frame.info().sequence, 3U);
  EXPECT_EQ(frame.info().flags, kFrameAfterGap);
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_EQ(frame.info().flags, kFrameNormal);
  EXPECT_EQ(camera.report().lost, 2U);
  EXPECT_EQ(camera.report().skipped, 0U);
}

TEST_F(SimCameraTest, RepeatedFrameIsTheOneBefore) {
  SimCamera camera(config(fault("repeat", 1), "luma"), link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  const auto first = pixels(frame);
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_EQ(frame.info().sequence, 1U);
  EXPECT_EQ(pixels(frame), first);
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_NE(pixels(frame), first);
}

TEST_F(SimCameraTest, TornFrameHasTheLowerHalfOfTheOneBefore) {
  SimCamera camera(config(fault("torn", 1), "luma"), link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  const auto first = pixels(frame);
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  const auto torn = pixels(frame);
  constexpr std::ptrdiff_t kHalf = 9600;  // 60 rows of 160
  EXPECT_TRUE(std::equal(torn.begin() + kHalf, torn.end(), first.begin() + kHalf));
  EXPECT_FALSE(std::equal(torn.begin(), torn.begin() + kHalf, first.begin()));
}

TEST_F(SimCameraTest, TruncatedFramesAreDamagedInEveryFormat) {
  for (const char* output : {"luma", "yuyv", "mjpeg"}) {
    SimCamera camera(config(fault("truncate", 1), output), link_);
    Frame frame;
    ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
    EXPECT_EQ(camera.grab(frame, 0s), GrabStatus::damaged) << output;
    EXPECT_EQ(frame.info().sequence, 0U);  // the frame held stays whole
    ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
    EXPECT_EQ(frame.info().sequence, 2U);
    EXPECT_EQ(camera.report().damaged, 1U);
  }
}

TEST_F(SimCameraTest, AutomaticExposureKeepsTheMeanUntilItsFaultEnds) {
  SimCamera locked(config(fault("covered", 5, 200), "luma"), link_);
  SimCamera automatic(config(fault("covered", 5, 200) + fault("auto_exposure", 1, 99), "luma"),
                      link_);
  Frame fixed;
  Frame frame;
  ASSERT_EQ(automatic.grab(frame, 0s), GrabStatus::ok);
  const double mean = mean_grey(frame);
  for (int i = 1; i < 100; ++i) ASSERT_EQ(automatic.grab(frame, 0s), GrabStatus::ok);
  for (int i = 0; i < 100; ++i) ASSERT_EQ(locked.grab(fixed, 0s), GrabStatus::ok);
  // Half of the light of a third of the picture is a sixth.
  EXPECT_NEAR(mean_grey(fixed), mean * 5 / 6, 2);
  EXPECT_NEAR(mean_grey(frame), mean, 0.2);
  EXPECT_NEAR(frame.luma().row(60)[120], fixed.luma().row(60)[120] * 1.2, 6);
  EXPECT_EQ(automatic.info().controls[0].verdict, ControlVerdict::confirmed);
  for (int i = 0; i < 2; ++i) ASSERT_EQ(automatic.grab(frame, 0s), GrabStatus::ok);
  EXPECT_NEAR(mean_grey(frame), mean_grey(fixed), 0.2);
}

TEST_F(SimCameraTest, ExposureAndGainMultiplyTheLight) {
  SimCamera camera(config("", "luma"), link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  const double mean = mean_grey(frame);
  camera.change({.exposure_us = 5000, .gain = {}});
  // The next frame is exposed already.
  for (int i = 0; i < 2; ++i) ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_NEAR(mean_grey(frame), mean / 2, 1);
  EXPECT_EQ(camera.info().controls[0].value, 500);
  camera.change({.exposure_us = {}, .gain = 1.5});
  for (int i = 0; i < 2; ++i) ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_NEAR(mean_grey(frame), mean * 0.75, 1);
  EXPECT_EQ(camera.info().settings.exposure_us->value, 5000);
  EXPECT_EQ(camera.info().settings.gain->value, 1.5);
}

TEST_F(SimCameraTest, StallAndUnplugEndAndSayWhatToDo) {
  SimCamera camera(config(fault("stall", 1, 2) + fault("unplug", 4, 3), "mjpeg"), link_);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_EQ(camera.grab(frame, 0s), GrabStatus::timeout);
  EXPECT_EQ(camera.report().state, CameraState::stalled);
  EXPECT_EQ(camera.grab(frame, 0s), GrabStatus::timeout);
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_EQ(frame.info().sequence, 3U);
  EXPECT_EQ(camera.report().state, CameraState::streaming);
  EXPECT_TRUE(camera.report().fix.empty());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(camera.grab(frame, 0s), GrabStatus::unplugged);
  EXPECT_EQ(camera.report().state, CameraState::unplugged);
  EXPECT_THAT(camera.report().fix, ::testing::HasSubstr("comes back"));
  EXPECT_EQ(camera.report().disconnects, 1U);
  ASSERT_EQ(camera.grab(frame, 0s), GrabStatus::ok);
  EXPECT_EQ(frame.info().sequence, 7U);
  EXPECT_EQ(frame.info().flags, kFrameAfterGap);
}

TEST_F(SimCameraTest, PacedFramesComeInOrderAndTheNewestFirst) {
  SimCamera camera(config("", "mjpeg", true), link_);
  camera.start();
  Frame frame;
  ASSERT_EQ(camera.grab(frame, 30s), GrabStatus::ok);
  std::uint64_t last = frame.info().sequence;
  std::int64_t when = frame.info().timestamp_ns;
  for (int i = 0; i < 20; ++i) {
    ASSERT_EQ(camera.grab(frame, 30s), GrabStatus::ok);
    EXPECT_GT(frame.info().sequence, last);
    EXPECT_GT(frame.info().timestamp_ns, when);
    last = frame.info().sequence;
    when = frame.info().timestamp_ns;
  }
  const CameraReport report = camera.report();
  EXPECT_EQ(report.delivered, 21U);
  EXPECT_EQ(report.delivered + report.lost + report.skipped, last + 1);
  EXPECT_EQ(camera.grab(frame, 0s), GrabStatus::timeout);
}

/// The machine's clock, but each wait is longer by five frames of the camera.
class LateClock final : public base::Clock {
 public:
  [[nodiscard]] std::int64_t monotonic_ns() const noexcept override {
    return base::system_clock().monotonic_ns();
  }
  [[nodiscard]] std::int64_t wall_ns() const noexcept override {
    return base::system_clock().wall_ns();
  }
  void sleep_until(std::int64_t deadline_ns) noexcept override {
    base::system_clock().sleep_until(deadline_ns + 50'000'000);
  }
};

TEST_F(SimCameraTest, FramesThatABusyMachineDoesNotMakeAreSkippedNotLost) {
  LateClock clock;
  SimCamera camera(config("", "luma", true), link_, clock);
  camera.start();
  Frame frame;
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(camera.grab(frame, 30s), GrabStatus::ok);
    EXPECT_EQ(frame.info().flags, kFrameNormal);
  }
  EXPECT_EQ(camera.report().lost, 0U);
  EXPECT_GE(camera.report().skipped, 6U);
}

TEST_F(SimCameraTest, PacedUnplugIsReportedAtOnceAndEnds) {
  // Two seconds: a machine that is busy for longer than that skips it.
  SimCamera camera(config(fault("unplug", 3, 200), "luma", true), link_);
  camera.start();
  Frame frame;
  GrabStatus status = GrabStatus::ok;
  while (status == GrabStatus::ok && frame.info().sequence < 203) {
    status = camera.grab(frame, 30s);
  }
  ASSERT_EQ(status, GrabStatus::unplugged);
  EXPECT_EQ(camera.report().disconnects, 1U);
  while (status != GrabStatus::ok) status = camera.grab(frame, 30s);
  EXPECT_GE(frame.info().sequence, 203U);
  EXPECT_EQ(frame.info().flags, kFrameAfterGap);
  EXPECT_EQ(camera.report().disconnects, 1U);
}

TEST_F(SimCameraTest, AHangKeepsTheCallThatAsksForAFrame) {
  SimCamera camera(config(fault("hang", 5, 50), "luma", true), link_);
  camera.start();
  Frame frame;
  std::chrono::nanoseconds longest{0};
  std::uint64_t last = 0;
  while (last < 55) {
    const auto began = std::chrono::steady_clock::now();
    if (camera.grab(frame, 1ms) == GrabStatus::ok) last = frame.info().sequence;
    longest = std::max<std::chrono::nanoseconds>(longest, std::chrono::steady_clock::now() - began);
  }
  EXPECT_GT(longest, 300ms);  // of the half second
  EXPECT_EQ(camera.report().state, CameraState::streaming);
}

TEST_F(SimCameraTest, NothingComesBeforeStart) {
  SimCamera camera(config("", "luma", true), link_);
  Frame frame;
  EXPECT_EQ(camera.grab(frame, 1ms), GrabStatus::timeout);
  EXPECT_FALSE(frame);
}

TEST_F(SimCameraTest, InfoNamesTheSensor) {
  const SimCamera camera(config("", "luma"), link_);
  EXPECT_EQ(camera.info().backend, "sim");
  EXPECT_EQ(camera.info().identity, "sim:dtact-sim");
  EXPECT_EQ(camera.info().width, 160);
  EXPECT_EQ(camera.info().fps, 100);
  EXPECT_EQ(camera.info().light_delay_frames, 2);
}

TEST_F(SimCameraTest, RefusesWhatItCannotDo) {
  CameraConfig settings = config("", "h264");
  EXPECT_THROW(SimCamera(settings, link_), std::runtime_error);
  settings = config("", "yuyv");
  settings.width = 161;
  EXPECT_THROW(SimCamera(settings, link_), std::runtime_error);
  settings.sim.scene = "/nonexistent/scene.toml";
  EXPECT_THROW(SimCamera(settings, link_), std::exception);
}

}  // namespace
}  // namespace dtact::hal::sim
