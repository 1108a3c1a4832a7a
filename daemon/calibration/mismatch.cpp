#include "daemon/calibration/mismatch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace dtact::calibration {

std::vector<std::string> camera_mismatches(const Calibration& calibration,
                                           const AttachedCamera& now) {
  std::vector<std::string> found;
  const Origin& then = calibration.origin;
  const recon::RectifyTable& frame = calibration.model->rectify;
  if (now.width != frame.frame_width || now.height != frame.frame_height) {
    found.push_back(fmt::format("the camera delivers {}x{} but was calibrated at {}x{}", now.width,
                                now.height, frame.frame_width, frame.frame_height));
  }
  if (!then.camera.empty() && now.identity != then.camera) {
    found.push_back(
        fmt::format("the camera is {} but {} was calibrated", now.identity, then.camera));
  }
  if (!then.pixel_format.empty() && now.pixel_format != then.pixel_format) {
    found.push_back(fmt::format("the pixel format is {} but was {} at calibration",
                                now.pixel_format, then.pixel_format));
  }
  if (then.fps > 0 && std::abs(now.fps - then.fps) > 0.01 * then.fps) {
    found.push_back(
        fmt::format("the frame rate is {} but was {} at calibration", now.fps, then.fps));
  }
  for (const Control& control : then.controls) {
    const auto same = std::ranges::find(now.controls, control.name, &Control::name);
    if (same == now.controls.end()) {
      found.push_back(fmt::format("the control {} was {} at calibration and is not reported now",
                                  control.name, control.value));
    } else if (same->value != control.value) {
      found.push_back(fmt::format("the control {} is {} but was {} at calibration", control.name,
                                  same->value, control.value));
    }
  }
  return found;
}

std::vector<std::string> light_mismatches(const Calibration& calibration,
                                          std::span<const std::uint8_t> leds) {
  const std::vector<std::uint8_t>& then = calibration.origin.leds;
  if (then.empty()) return {};
  if (leds.size() != then.size()) {
    return {fmt::format("the ring has {} LEDs but {} were calibrated", leds.size() / 3,
                        then.size() / 3)};
  }
  std::vector<std::string> found;
  for (std::size_t i = 0; i + 2 < then.size(); i += 3) {
    if (!std::ranges::equal(leds.subspan(i, 3), std::span(then).subspan(i, 3))) {
      found.push_back(fmt::format("LED {} shows {} {} {} but showed {} {} {} at calibration", i / 3,
                                  leds[i], leds[i + 1], leds[i + 2], then[i], then[i + 1],
                                  then[i + 2]));
    }
  }
  return found;
}

}  // namespace dtact::calibration
