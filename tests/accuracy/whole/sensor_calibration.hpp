#pragma once

#include <filesystem>
#include <string>

#include "tests/accuracy/whole/random_draw.hpp"

namespace dtact::whole {

/// Makes a sensor's calibration folder as a user does, by dtact-calibrate from averaged images: a
/// lens from one press of the board of pins where the camera distorts, depth from one press of a
/// ball of 4 mm, force from eleven loads on a scale that shows whole grams. A press that the
/// program refuses is repeated deeper, up to three times. Returns what the program printed. Throws
/// std::runtime_error with its message when it refuses all.
std::string calibrate(const RandomSensor& sensor, const std::filesystem::path& folder);

}  // namespace dtact::whole
