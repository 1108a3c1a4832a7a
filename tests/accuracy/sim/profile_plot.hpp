#pragma once

#include <string>
#include <vector>

#include "tests/accuracy/sim/ball_profile.hpp"

namespace dtact::accuracy {

struct ProfilePanel {
  std::string title;
  Profile real;
  Profile simulated;
};

/// Darkening over radius, real points on the simulated line, the difference below; one panel a
/// sensor.
[[nodiscard]] std::string profile_svg(const std::vector<ProfilePanel>& panels);

}  // namespace dtact::accuracy
