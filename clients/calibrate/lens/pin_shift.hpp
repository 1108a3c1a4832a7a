#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>

#include "clients/calibrate/lens/point_fit.hpp"

namespace dtact::ctl {

/// How the camera's height shows in a board of pins. What is pressed in lies nearer to the camera
/// and appears farther from the foot of the camera's axis, so that a pin's spot is skewed outwards:
/// its tip more than its rim, in proportion to the pin's distance from the foot.
struct PinShift {
  recon::Point foot_mm;  ///< axis_foot() of the lens.
  /// Share of its distance from the foot by which a point appears farther out, for each grey level
  /// of darkening: 1 / height times the LUT's millimetres a grey level.
  double per_level = 0;
  double error = 0;  ///< Its standard error: bootstrap over the pins.
  /// The share by which the pins' own places appear farther out.
  double of_pins = 0;

  /// Above four standard errors.
  [[nodiscard]] bool sure() const noexcept { return per_level > 4 * error; }
  /// A description of one sentence.
  [[nodiscard]] std::string describe() const;
};

/// Measures it. v(r), the first angular harmonic of the darkening at the distance r from a pin's
/// place, is −S′(r) times the shift of what lies there against the pin, with S the mean profile of
/// the pins. Over all pins v has a slope g(r) against the pin's position from the foot, and
/// g = −per_level · S · S′ + of_pins · S′ in least squares. `pitch_mm`: of the board.
///
/// `reference`, `frame`: grey levels; `marks`: from find_pins(), `lens` through them.
[[nodiscard]] PinShift measure_pin_shift(const cv::Mat1f& reference, const cv::Mat1f& frame,
                                         std::span<const Mark> marks, const recon::Lens& lens,
                                         double pitch_mm);

/// The lens of the undeformed surface, from one of the pressed pins.
[[nodiscard]] recon::Lens undeformed(const recon::Lens& lens, const PinShift& shift);

}  // namespace dtact::ctl
