#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "clients/calibrate/lens/pin_gain.hpp"
#include "clients/calibrate/lens/pins.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl {

/// How evenly a calibration reads the pins of a board, which are equally long.
struct PinDepths {
  /// Depth of each pin inside the trusted map, at its centre (a paraboloid about it), with the gain
  /// that the other pins chose.
  std::vector<double> mm;
  double mean_mm = 0;
  double tilt_x_um_per_mm = 0;  ///< Slope of the plane through them, removed below.
  double tilt_y_um_per_mm = 0;
  double spread = 0;  ///< Standard deviation without the tilt over the mean.
};

/// `calibration` is on the image that the pins' lens rectifies, `gain` the pins' choice,
/// `reference_q8` and `frames` images of the board. Throws std::runtime_error when fewer than three
/// in four pins are inside the trusted map or they read no depth; else like mean_depth_um().
[[nodiscard]] PinDepths read_pins(const PinPress& pins, const PinGain& gain,
                                  const calibration::Calibration& calibration,
                                  std::span<const std::uint16_t> reference_q8,
                                  std::span<const image::Grey8> frames, const Board& board,
                                  int sharpen_steps = 0);

}  // namespace dtact::ctl
