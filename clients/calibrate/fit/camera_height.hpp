#pragma once

#include "clients/calibrate/fit/press_set.hpp"

namespace dtact::calibration {

/// Presses that show the camera's height; with fewer a gain of the field looks the same.
inline constexpr std::size_t kHeightPresses = 4;

/// The set's view with the height that its presses show, where that is assumed; else unchanged.
///
/// Beside the camera's axis the deep middle of a contact appears farther out than its rim. In least
/// squares over the sure part of all contacts, seen as they appear, LUT(gain · darkening) is the
/// sphere about each press's own centre at its own depth, the points lying where 1 / height puts
/// them. LUT, centres, depths, height and a gain 1 + a·x + b·y + c·(x² + y²) of the field are
/// unknown: in one press a gain that falls off outwards looks like a low camera, but from press to
/// press it also changes the darkening of a millimetre.
///
/// The error sums, in squares, the jackknife over the presses and what simulated gels miss by, all
/// presses alike. The height is believed above four errors and from kMinPerMm to kMaxPerMm.
[[nodiscard]] CameraView view_of_presses(const BallPresses& set);

}  // namespace dtact::calibration
