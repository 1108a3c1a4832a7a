#pragma once

#include <cmath>
#include <cstdint>

#include "clients/calibrate/fit/build.hpp"
#include "tests/accuracy/real/press_images.hpp"

namespace dtact {

/// Images of a ball, without a lens, as input of a calibration.
[[nodiscard]] inline calibration::BallPress ball_press(const PressImages& images, double mm_per_px,
                                                       double radius_mm = 4) {
  calibration::BallPress press;
  press.reference_q8 = {images.reference.cols, images.reference.rows, {}};
  for (const float level : images.reference) {
    press.reference_q8.pixels.push_back(static_cast<std::uint16_t>(std::lround(256 * level)));
  }
  press.frames = {{images.frame.cols, images.frame.rows, {}}};
  for (const float level : images.frame) {
    press.frames[0].pixels.push_back(static_cast<std::uint8_t>(std::lround(level)));
  }
  press.mm_per_px = mm_per_px;
  press.ball_radius_mm = radius_mm;
  return press;
}

}  // namespace dtact
