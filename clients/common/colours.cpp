#include "clients/common/colours.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dtact::cli {

Colour colour_of(double share) {
  const double lambda = 0.1 + 0.83 * std::clamp(share, 0.0, 1.0);
  const double angle = 2 * std::numbers::pi * (0.2 / 3 + 1 - 0.6 * lambda);
  const double amplitude = 1.3 * lambda * (1 - lambda) / 2;
  const double cosine = std::cos(angle);
  const double sine = std::sin(angle);
  const auto part = [&](double of_cosine, double of_sine) {
    const double value = lambda + amplitude * (of_cosine * cosine + of_sine * sine);
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
  };
  return {part(-0.14861, 1.78277), part(-0.29227, -0.90649), part(1.97294, 0)};
}

double round_up(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= value * (1 - 1e-9)) return factor * decade;
  }
  return 10 * decade;
}

double full_scale_mm(double deepest_mm) { return round_up(std::max(deepest_mm, 0.2)); }

}  // namespace dtact::cli
