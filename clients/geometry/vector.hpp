#pragma once

#include <array>

namespace dtact::perceive {

/// A point or direction of the surface frame.
using Vector = std::array<double, 3>;

constexpr double kMetre = 1e-3;  ///< Metres per millimetre.

/// `t` times `direction` further than `from`.
inline Vector along(const Vector& from, double t, const Vector& direction) {
  return {from[0] + t * direction[0], from[1] + t * direction[1], from[2] + t * direction[2]};
}

}  // namespace dtact::perceive
