#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "hal/sim/objects.hpp"

namespace dtact::recognition {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kReach = 40;  ///< More than any gel, mm.

/// Distance to an outline in the plane, negative inside.
inline double circle(double x, double y, double radius) { return std::hypot(x, y) - radius; }
inline double box(double x, double y, double half_x, double half_y) {
  return std::max(std::abs(x) - half_x, std::abs(y) - half_y);
}
/// Depth below the top of a circle at `r` from its middle.
inline double round_top(double radius, double r) {
  return r < radius ? radius - std::sqrt(radius * radius - r * r) : hal::sim::kNoSurface;
}

/// A flat face inside an outline, its rim chamfered by 45 degrees.
inline double face(double outline, double chamfer) {
  return outline > 0 ? hal::sim::kNoSurface : std::max(0.0, chamfer + outline);
}

template <typename Height>
hal::sim::Object object(const Height& height) {
  return {"", kReach, height};
}

}  // namespace dtact::recognition
