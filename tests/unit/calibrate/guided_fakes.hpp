#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/guided/console.hpp"
#include "clients/calibrate/guided/sensor.hpp"

namespace dtact::ctl::guided::test {

/// What the fake sensor shows for some frames: a ball of 4 mm on a surface of grey 200 that darkens
/// by 30 levels a millimetre, 0.05 mm a pixel; depth 0 is no contact.
struct Scene {
  double depth_mm = 0;
  double x_px = 160;  ///< Position of the lowest point.
  double y_px = 150;
  int frames = 60;
  double step_mm = 0;  ///< Added with each frame: a press in motion.
};

inline constexpr int kWidth = 320;
inline constexpr int kHeight = 300;

inline v1::LumaMap picture(const Scene& scene, double depth_mm, std::uint32_t seed) {
  v1::LumaMap map;
  map.set_encoding(v1::LUMA_GREY8);
  map.set_width(kWidth);
  map.set_height(kHeight);
  std::string& pixels = *map.mutable_data();
  pixels.resize(std::size_t{kWidth} * kHeight);
  std::uint32_t noise = seed * 2654435761U + 1;
  std::size_t i = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      long dark = 0;
      const double dx = 0.05 * (x - scene.x_px);
      const double dy = 0.05 * (y - scene.y_px);
      const double r2 = dx * dx + dy * dy;
      // Where the ball is below the surface.
      if (r2 < 2 * 4 * depth_mm) {
        const double sag = 4 - std::sqrt(std::max(0.0, 16 - r2));
        dark = std::lround(30 * std::max(0.0, depth_mm - sag));
      }
      noise = noise * 1664525U + 1013904223U;
      const int grain = static_cast<int>(noise >> 30U) - 1;  // −1 … 2
      pixels[i++] = static_cast<char>(200 - dark + grain);
    }
  }
  return map;
}

/// Plays scenes one after another, the last without end, 60 frames a second of its own time.
class FakeSensor : public Sensor {
 public:
  explicit FakeSensor(std::vector<Scene> scenes) : scenes_(std::move(scenes)) {
    now.set_state(v1::STATE_UNCALIBRATED);
    now.add_health(v1::HEALTH_UNCALIBRATED);
    v1::CameraStatus& camera = *now.mutable_camera();
    camera.set_identity("fake:1");
    camera.set_pixel_format("mjpeg");
    camera.set_width(kWidth);
    camera.set_height(kHeight);
    camera.set_fps(60);
    v1::CameraControl& exposure = *camera.add_controls();
    exposure.set_name("exposure");
    exposure.set_value(100);
    exposure.set_locked(true);
    now.mutable_light()->set_brightness(255);
    for (int i = 0; i < 8; ++i) {
      v1::Rgb& led = *now.mutable_light()->add_leds();
      led.set_r(255);
      led.set_g(255);
      led.set_b(255);
    }
  }

  [[nodiscard]] std::string program() const override { return "fake 1.0"; }
  [[nodiscard]] v1::Status status() override {
    if (on_status) on_status(now);
    return now;
  }
  [[nodiscard]] std::optional<v1::Frame> next(std::chrono::milliseconds) override {
    if (frames_until_gone == 0) throw client::ConnectionError("the daemon ended the connection");
    if (frames_until_gone > 0) --frames_until_gone;
    if (silent) return std::nullopt;
    while (scene_ + 1 < scenes_.size() && in_scene_ >= scenes_[scene_].frames) {
      ++scene_;
      in_scene_ = 0;
    }
    const Scene& scene = scenes_[scene_];
    v1::Frame frame;
    frame.set_sequence(++sequence_);
    frame.set_monotonic_ns(static_cast<std::int64_t>(sequence_) * 16'666'667);
    *frame.mutable_health() = now.health();
    *frame.mutable_light() = now.light();
    const double depth_mm = scene.depth_mm + in_scene_ * scene.step_mm;
    *frame.mutable_luma() =
        paint ? paint(scene) : picture(scene, depth_mm, static_cast<std::uint32_t>(sequence_));
    ++in_scene_;
    return frame;
  }
  void upload(const v1::UploadCalibration& files) override {
    uploaded = files;
    const std::string& toml = files.calibration_toml();
    v1::CalibrationSummary& calibration = *now.mutable_calibration();
    calibration.set_name(files.name());
    calibration.set_created(toml.substr(toml.find("created = \"") + 11, 20));
  }

  v1::Status now;
  std::function<void(v1::Status&)> on_status;
  std::function<v1::LumaMap(const Scene&)> paint;  ///< Used instead of picture().
  std::optional<v1::UploadCalibration> uploaded;
  bool silent = false;
  int frames_until_gone = -1;  ///< Negative: never.

 private:
  std::vector<Scene> scenes_;
  std::size_t scene_ = 0;
  int in_scene_ = 0;
  std::uint64_t sequence_ = 0;
};

/// Types prepared lines, then ends. "~30" types nothing the next 30 times.
class FakeConsole : public Console {
 public:
  explicit FakeConsole(std::deque<std::string> lines) : lines_(std::move(lines)) {}

  [[nodiscard]] bool interactive() const override { return person; }
  [[nodiscard]] Typed typed() override {
    if (!lines_.empty() && lines_.front().starts_with('~')) {
      pauses_ = std::stoi(lines_.front().substr(1));
      lines_.pop_front();
    }
    if (pauses_ > 0) {
      --pauses_;
      return {};
    }
    if (lines_.empty()) return {Typed::Kind::end, {}};
    Typed typed{Typed::Kind::line, lines_.front()};
    lines_.pop_front();
    return typed;
  }
  [[nodiscard]] bool interrupted() const override { return ctrl_c; }
  void say(const std::string& text) override { said += text + "\n"; }
  void keep(const image::Grey8&) override {}
  void live(const guided::Scene& scene) override {
    drew = drew || scene.picture != nullptr;
    drawn = scene;
  }

  std::string said;
  guided::Scene drawn;
  bool drew = false;  ///< Whether a picture was drawn.
  bool person = false;
  bool ctrl_c = false;

 private:
  int pauses_ = 0;
  std::deque<std::string> lines_;
};

}  // namespace dtact::ctl::guided::test
