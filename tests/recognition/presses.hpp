#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include "clients/perceive/recognition/touch_map.hpp"
#include "hal/files/png.hpp"
#include "tests/accuracy/whole/random_draw.hpp"

namespace dtact::recognition {

/// A press and its truth.
struct Press {
  int kind = 0;  ///< Index into kinds().
  int variant = 0;
  int number = 0;           ///< On its sensor; the frames of one press share it.
  double thickness_mm = 0;  ///< Of the gel.
  double depth_mm = 0;
  double x_mm = 0;
  double y_mm = 0;
  double newtons = 0;
};

/// Simulated presses on one sensor that is drawn at random: gel of 1 to 3 mm, scattering, noise,
/// response, light. The sensor is calibrated by a press of a ball, as a user does.
struct Wanted {
  std::uint64_t seed = 1;
  int sensor = 0;
  int presses = 60;
  int frames = 1;  ///< Of each press: at one place, each at a depth of its own.
  int lights = 4;  ///< The calibration's, another brightness, and the rest each without one LED.
  /// Draws what is pressed: kind and variant.
  std::function<std::pair<int, int>(whole::Draw&)> object;
  double grid_mm = 0.25;   ///< Of the contact.
  int camera_width = 400;  ///< Pixels; the field stays.
};

using TakePress =
    std::function<void(const Press&, const perceive::TouchMap&, const image::Grey8& camera_image)>;

/// Calls `take` for each frame that presses by at most 80 N and whose depth map shows a contact.
/// Returns false, without a press, for a sensor whose calibration is refused.
bool make_presses(const Wanted& wanted, const TakePress& take);

}  // namespace dtact::recognition
