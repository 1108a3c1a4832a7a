#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "daemon/calibration/calibration.hpp"

namespace dtact::calibration {

/// The camera as it runs now, in the calibration's terms.
struct AttachedCamera {
  std::string identity;
  std::string pixel_format;
  int width = 0;   ///< Pixels.
  int height = 0;  ///< Pixels.
  double fps = 0;
  std::vector<Control> controls;
};

/// One sentence for each difference between the camera now and the one the calibration was made
/// with; empty when they agree. What the calibration did not record is not compared, but the
/// frame's size always is. Frame rates may differ by 1 %.
[[nodiscard]] std::vector<std::string> camera_mismatches(const Calibration& calibration,
                                                         const AttachedCamera& now);

/// One sentence for each LED (numbered from 0) whose colour differs from that at calibration; empty
/// when all agree or the calibration did not record the light. `leds`: r, g, b of each
/// LED.
[[nodiscard]] std::vector<std::string> light_mismatches(const Calibration& calibration,
                                                        std::span<const std::uint8_t> leds);

}  // namespace dtact::calibration
