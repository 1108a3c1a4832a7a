// dtactd and its clients on the real uvcvideo.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "hal/base/atomic_file.hpp"
#include "tests/e2e/sensor.hpp"
#include "tests/kernel/camera/guest_camera.hpp"

namespace dtact::kernel_test {
namespace {

/// A client that watches until stop(). It never connects again.
class Watcher {
 public:
  explicit Watcher(std::uint16_t port)
      : client_(client::Options{.host = "127.0.0.1", .port = port}) {
    client_.subscribe();
    thread_ = std::thread([this] { run(); });
  }
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;
  ~Watcher() {
    stop_ = true;
    thread_.join();
  }

  [[nodiscard]] int frames() const { return frames_; }
  [[nodiscard]] int frames_with_depth() const { return with_depth_; }
  [[nodiscard]] int contacts() const { return contacts_; }
  [[nodiscard]] int references() const { return references_; }
  /// The deepest point of any contact so far.
  [[nodiscard]] double deepest_mm() const { return deepest_mm_; }
  [[nodiscard]] bool broken() const { return broken_; }
  [[nodiscard]] v1::State state() const { return state_; }

 private:
  void run() {
    try {
      while (!stop_) {
        const auto item = client_.next(std::chrono::milliseconds(100));
        if (!item) continue;
        if (const auto* frame = std::get_if<v1::Frame>(&*item)) {
          ++frames_;
          if (frame->has_depth()) ++with_depth_;
          if (frame->contact().deepest_mm() > deepest_mm_)
            deepest_mm_ = frame->contact().deepest_mm();
          continue;
        }
        const auto& event = std::get<v1::Event>(*item);
        if (event.has_state()) state_ = event.state().state();
        if (event.contact().contact().in_contact()) ++contacts_;
        if (event.has_reference()) ++references_;
      }
    } catch (const client::Error&) {
      broken_ = true;
    }
  }

  client::Client client_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> broken_{false};
  std::atomic<int> frames_{0};
  std::atomic<int> with_depth_{0};
  std::atomic<int> contacts_{0};
  std::atomic<int> references_{0};
  std::atomic<double> deepest_mm_{0};
  std::atomic<v1::State> state_{v1::STATE_UNSPECIFIED};
  std::thread thread_;
};

/// Pictures of the sensor's camera, as JPEG: two seconds without contact, one second with a ball
/// pressed in. Rendered by the simulator.
const std::string& sensor_pictures() {
  static const e2e::TempFolder folder;
  static const std::string pictures = [] {
    const auto render = [](const char* frames, const char* prefix) {
      const e2e::TempFolder png;
      std::string output;
      if (e2e::run_program(
              {DTACT_SIM_RENDER, "--scene", e2e::scene_file("calibrate_ball.toml").string(),
               "--frames", frames, "-o", png.path().string()},
              &output) != 0) {
        throw std::runtime_error(output);
      }
      for (const auto& entry : std::filesystem::directory_iterator(png.path())) {
        const std::string name = prefix + entry.path().stem().string() + ".jpg";
        base::write_file_atomically(folder.path() / name,
                                    encode_jpeg(image::read_png_grey8(entry.path())));
      }
    };
    render("0:120", "a");
    render("200:260", "b");
    return folder.path().string();
  }();
  return pictures;
}

class Daemon : public GuestCamera {
 protected:
  void start(const std::vector<std::string>& settings = {}) {
    std::vector<std::string> arguments{"--set", "camera.backend=v4l2",
                                       "--set", "camera.v4l2.device=serial:0001",
                                       "--set", "camera.v4l2.pixel_format=mjpeg",
                                       "--set", "camera.v4l2.controls.gain=20",
                                       "--set", "ring.backend=null",
                                       "--set", "net.port=0",
                                       "--set", "state_dir=" + state_.path().string()};
    for (const std::string& setting : settings) {
      arguments.emplace_back("--set");
      arguments.push_back(setting);
    }
    daemon_ = std::make_unique<e2e::DaemonProcess>(arguments);
  }

  [[nodiscard]] v1::Status status() const {
    client::Client asking(client::Options{.host = "127.0.0.1", .port = daemon_->port()});
    return asking.status();
  }

  e2e::TempFolder state_;
  std::unique_ptr<e2e::DaemonProcess> daemon_;
};

TEST_F(Daemon, ComesUpWithoutACameraAndServesItOncePlugged) {
  wait_for_no_camera();
  start();
  v1::Status s = status();
  EXPECT_EQ(s.camera().state(), "unplugged");
  EXPECT_NE(s.camera().fix().find("plug it in"), std::string::npos) << s.camera().fix();
  const UsbCamera usb({folder()});
  ASSERT_TRUE(eventually(kTimeout, [&] { return status().camera().state() == "streaming"; }));
  s = status();
  EXPECT_EQ(s.camera().pixel_format(), "MJPEG");
  EXPECT_EQ(s.camera().identity(), "serial:0001");
  EXPECT_FALSE(s.camera().controls().empty());
  EXPECT_EQ(daemon_->stop(SIGTERM), 0);
}

TEST_F(Daemon, FourClientsWatchThroughAnUnplug) {
  std::optional<UsbCamera> usb;
  usb.emplace(std::vector<std::string>{"-i", folder()});
  wait_for_camera();
  start({"calibration=" + e2e::calibration_folder().string()});
  std::vector<std::unique_ptr<Watcher>> watchers;
  watchers.reserve(4);
  for (int i = 0; i < 4; ++i) watchers.push_back(std::make_unique<Watcher>(daemon_->port()));
  const auto all = [&](const auto& condition) {
    return eventually(kTimeout, [&] { return std::ranges::all_of(watchers, condition); });
  };
  ASSERT_TRUE(all([](const auto& w) { return w->frames() > 30; }));

  for (int cycle = 0; cycle < 3; ++cycle) {
    double begin = now_s();
    usb.reset();
    ASSERT_TRUE(all([](const auto& w) { return w->state() == v1::STATE_CAMERA_LOST; }));
    measured("unplug to camera_lost at four clients", now_s() - begin, "s");
    EXPECT_EQ(status().camera().state(), "unplugged");
    std::vector<int> before;
    before.reserve(watchers.size());
    for (const auto& w : watchers) before.push_back(w->frames());

    begin = now_s();
    usb.emplace(std::vector<std::string>{"-i", folder()});  // all controls automatic again
    ASSERT_TRUE(eventually(kTimeout, [&] {
      for (std::size_t i = 0; i < watchers.size(); ++i) {
        if (watchers[i]->frames() <= before[i]) return false;
      }
      return true;
    }));
    measured("re-plug to frames at four clients", now_s() - begin, "s");
    ASSERT_TRUE(all([](const auto& w) { return w->state() != v1::STATE_CAMERA_LOST; }));
    // Frames that come late on a busy machine stall it for a moment.
    ASSERT_TRUE(eventually(kTimeout, [&] { return status().camera().state() == "streaming"; }));
    const v1::Status s = status();
    EXPECT_EQ(s.camera().disconnects(), static_cast<std::uint64_t>(cycle + 1));
    for (const auto& control : s.camera().controls()) {
      EXPECT_NE(control.verdict(), v1::CONTROL_VERDICT_REFUSED)
          << control.name() << ": " << control.note();
      if (control.name() == "gain") {
        EXPECT_EQ(control.value(), 20);
      }
    }
  }
  const double begin = now_s();
  const int first = watchers[0]->frames();
  std::this_thread::sleep_for(std::chrono::seconds(3));
  measured("frames at the first of four clients",
           (watchers[0]->frames() - first) / (now_s() - begin), "frames/s");
  for (const auto& w : watchers) {
    EXPECT_FALSE(w->broken());
  }
  watchers.clear();
  EXPECT_EQ(daemon_->stop(SIGTERM), 0);
}

TEST_F(Daemon, StreamsDepthThroughAnUnplug) {
  std::optional<UsbCamera> usb;
  usb.emplace(std::vector<std::string>{"-i", sensor_pictures()});
  wait_for_camera();
  start({"calibration=" + e2e::calibration_folder().string()});
  Watcher watcher(daemon_->port());
  const auto depth_and_contact = [&] {
    const int depth = watcher.frames_with_depth();
    const int contacts = watcher.contacts();
    return eventually(kTimeout, [&] {
      return watcher.frames_with_depth() > depth + 10 && watcher.contacts() > contacts;
    });
  };
  ASSERT_TRUE(depth_and_contact()) << status().state() << ": " << status().advice();
  const int first = watcher.frames_with_depth();
  double begin = now_s();
  std::this_thread::sleep_for(std::chrono::seconds(4));
  const double rate = (watcher.frames_with_depth() - first) / (now_s() - begin);
  measured("depth at a client", rate, "frames/s");
  const v1::Status serving = status();
  measured("frames published by the daemon", serving.fps(), "frames/s");
  for (const auto& stage : serving.stages())
    measured(stage.stage() + ", p50", stage.p50_us(), "us");

  usb.reset();
  ASSERT_TRUE(eventually(kTimeout, [&] { return watcher.state() == v1::STATE_CAMERA_LOST; }));
  wait_for_no_camera();
  begin = now_s();
  const int before = watcher.frames();
  const int depth_before = watcher.frames_with_depth();
  usb.emplace(std::vector<std::string>{"-i", sensor_pictures()});
  ASSERT_TRUE(eventually(kTimeout, [&] { return watcher.frames() > before; }));
  measured("re-plug to the first frame at a client", now_s() - begin, "s");
  ASSERT_TRUE(eventually(kTimeout, [&] { return watcher.frames_with_depth() > depth_before; }));
  measured("re-plug to the first depth at a client", now_s() - begin, "s");
  ASSERT_TRUE(depth_and_contact()) << status().state() << ": " << status().advice();
  // A ball of 4 mm radius, pressed as in config/scenes/calibrate_ball.toml.
  EXPECT_GT(watcher.deepest_mm(), 0.5);
  EXPECT_LT(watcher.deepest_mm(), 2.0);
  EXPECT_FALSE(watcher.broken());
  EXPECT_EQ(daemon_->stop(SIGTERM), 0);
}

// The stream freezes for so long that it is closed and reopened, though the camera was never away:
// its controls are set and the reference is taken again, and depth is right against that.
TEST_F(Daemon, MeasuresDepthAgainstANewReferenceAfterAFreeze) {
  const UsbCamera usb({"-i", sensor_pictures()});
  wait_for_camera();
  start({"calibration=" + e2e::calibration_folder().string()});
  const Watcher before(daemon_->port());
  ASSERT_TRUE(eventually(kTimeout, [&] { return before.contacts() > 0; })) << status().advice();
  const int references = before.references();
  usb.toggle_freeze();
  ASSERT_TRUE(eventually(kTimeout, [&] { return status().camera().state() == "stalled"; }));
  std::this_thread::sleep_for(std::chrono::seconds(4));
  usb.toggle_freeze();
  ASSERT_TRUE(eventually(kTimeout, [&] { return before.references() > references; }));
  EXPECT_EQ(status().camera().disconnects(), 0U);
  const Watcher after(daemon_->port());
  ASSERT_TRUE(eventually(kTimeout, [&] { return after.contacts() > 0; })) << status().advice();
  // A ball of 4 mm radius, pressed as in config/scenes/calibrate_ball.toml.
  EXPECT_GT(after.deepest_mm(), 0.5);
  EXPECT_LT(after.deepest_mm(), 2.0);
  EXPECT_EQ(daemon_->stop(SIGTERM), 0);
}

TEST_F(Daemon, ReportsAFreezeAndAMovedControl) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  start();
  const Watcher watcher(daemon_->port());
  ASSERT_TRUE(eventually(kTimeout, [&] { return status().camera().state() == "streaming"; }));
  usb.toggle_freeze();
  ASSERT_TRUE(eventually(kTimeout, [&] { return status().camera().state() == "stalled"; }));
  EXPECT_TRUE(
      eventually(kTimeout, [&] { return e2e::has(status().health(), v1::HEALTH_CAMERA_FAULT); }));
  usb.toggle_freeze();
  ASSERT_TRUE(eventually(kTimeout, [&] { return status().camera().state() == "streaming"; }));
  usb.drift();
  ASSERT_TRUE(eventually(kTimeout,
                         [&] { return e2e::has(status().health(), v1::HEALTH_CAMERA_MISMATCH); }));
  ASSERT_TRUE(eventually(kTimeout,
                         [&] { return !e2e::has(status().health(), v1::HEALTH_CAMERA_MISMATCH); }));
  EXPECT_EQ(daemon_->stop(SIGTERM), 0);
}

}  // namespace
}  // namespace dtact::kernel_test
