#pragma once

#include <span>
#include <vector>

#include "hal/sim/objects.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::study {

/// The force that holds an object at each depth, divided by Young's modulus: N / MPa = mm².
[[nodiscard]] std::vector<double> force_over_modulus(const hal::sim::GelModel& gel,
                                                     const hal::sim::Object& object,
                                                     std::span<const double> depths_mm);

/// The depth d₀ of a ball's first contact when F = a (d − d₀)^1.5, Hertz's law for a half-space, is
/// fitted to forces at known depths (a line through F^⅔), mm below the true surface.
[[nodiscard]] double hertz_zero_mm(std::span<const double> depths_mm,
                                   std::span<const double> forces);

}  // namespace dtact::study
