#include "clients/calibrate/guided/sensor_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>

#include "clients/calibrate/fit/build.hpp"
#include "clients/cpp/names.hpp"
#include "daemon/calibration/mismatch.hpp"

namespace dtact::ctl::guided {
namespace {

// The daemon's own limits (daemon/pipeline/image_watch.cpp).
constexpr double kDarkGrey = 20;
constexpr double kWhiteShare = 0.01;
constexpr std::uint8_t kWhite = 254;
constexpr double kNoise = 2.5;

using HealthFlags = google::protobuf::RepeatedField<int>;

bool has_any(const HealthFlags& health, std::initializer_list<v1::Health> wanted) {
  return std::ranges::any_of(
      health, [&](int flag) { return std::ranges::find(wanted, flag) != wanted.end(); });
}

}  // namespace

std::string unfit(const v1::Status& status) {
  if (status.state() == v1::STATE_CAMERA_LOST ||
      has_any(status.health(),
              {v1::HEALTH_CAMERA_FAULT, v1::HEALTH_RING_FAULT, v1::HEALTH_IMAGE_SATURATED,
               v1::HEALTH_IMAGE_DARK, v1::HEALTH_LIGHT_BANDED})) {
    return status.advice().empty() ? "the daemon's state is " + client::name_of(status.state())
                                   : status.advice();
  }
  return {};
}

bool passing_trouble(const HealthFlags& health) {
  return has_any(health, {v1::HEALTH_STARTING, v1::HEALTH_LIGHT_UNSETTLED,
                          v1::HEALTH_IMAGE_REPEATED, v1::HEALTH_CAMERA_FAULT});
}

std::string fault_of(const SteadyFrames& still, const recon::RectifyTable& table) {
  const double mean = std::accumulate(still.cells.begin(), still.cells.end(), 0.0) /
                      static_cast<double>(still.cells.size());
  if (mean < kDarkGrey) {
    return fmt::format(
        "the picture is too dark (mean grey {:.0f}): raise the light (dtactctl led) "
        "or the exposure",
        mean);
  }
  const image::Grey8 map = calibration::rectified_mean(table, {still.frames.front()});
  const auto white = std::ranges::count_if(map.pixels, [](auto grey) { return grey >= kWhite; });
  const double share = static_cast<double>(white) / static_cast<double>(map.pixels.size());
  if (share > kWhiteShare) {
    return fmt::format(
        "{:.0f} % of the picture is white: lower the light (dtactctl led) or the "
        "exposure",
        100 * share);
  }
  if (still.noise_levels > kNoise) {
    return fmt::format(
        "pixels are noisy ({:.1f} grey levels from frame to frame, {} are allowed): "
        "raise the light and lower the camera's gain",
        still.noise_levels, kNoise);
  }
  return {};
}

calibration::Origin origin_of(const v1::Status& status) {
  calibration::Origin origin;
  origin.camera = status.camera().identity();
  origin.pixel_format = status.camera().pixel_format();
  origin.fps = status.camera().fps();
  for (const auto& control : status.camera().controls()) {
    origin.controls.push_back({control.name(), control.value()});
  }
  origin.leds = leds_of(status.light());
  return origin;
}

std::vector<std::uint8_t> leds_of(const v1::LightState& light) {
  std::vector<std::uint8_t> leds;
  const double factor =
      std::pow(light.brightness() / 255.0, light.gamma() > 0 ? light.gamma() : 1.0);
  for (const v1::Rgb& led : light.leds()) {
    for (const std::uint32_t channel : {led.r(), led.g(), led.b()}) {
      leds.push_back(static_cast<std::uint8_t>(std::lround(channel * factor)));
    }
  }
  return leds;
}

std::vector<std::string> differences(const calibration::Origin& then, const v1::Status& now,
                                     int frame_width, int frame_height) {
  auto model = std::make_shared<recon::Model>();
  model->rectify.frame_width = frame_width;
  model->rectify.frame_height = frame_height;
  calibration::Calibration taken;
  taken.model = std::move(model);
  taken.origin = then;
  const calibration::Origin origin = origin_of(now);
  std::vector<std::string> found =
      calibration::camera_mismatches(taken, {.identity = origin.camera,
                                             .pixel_format = origin.pixel_format,
                                             .width = static_cast<int>(now.camera().width()),
                                             .height = static_cast<int>(now.camera().height()),
                                             .fps = origin.fps,
                                             .controls = origin.controls});
  const std::vector<std::string> light = calibration::light_mismatches(taken, origin.leds);
  // Eight LEDs dimmed together are one difference.
  found.insert(found.end(), light.begin(), light.begin() + (light.empty() ? 0 : 1));
  if (light.size() > 1) found.back() += fmt::format(" ({} more LEDs differ)", light.size() - 1);
  return found;
}

}  // namespace dtact::ctl::guided
