#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>

#include "daemon/recon/surface.hpp"

namespace dtact::perceive::test {

/// A sphere or cylinder as the heights of nodes × nodes, in whole micrometres.
inline recon::Surface sampled(const recon::Surface& round, int nodes, double spacing_mm) {
  using Kind = recon::Surface::Kind;
  recon::SurfaceHeights heights{
      .width = nodes, .height = nodes, .spacing_mm = spacing_mm, .z_um = {}};
  const double angle = round.axis_deg * std::numbers::pi / 180;
  for (int row = 0; row < nodes; ++row) {
    for (int column = 0; column < nodes; ++column) {
      const double x = (column - 0.5 * (nodes - 1)) * spacing_mm;
      const double y = (row - 0.5 * (nodes - 1)) * spacing_mm;
      const double off = round.kind == Kind::sphere
                             ? std::hypot(x, y)
                             : std::abs(y * std::cos(angle) - x * std::sin(angle));
      const double z = std::sqrt(round.radius_mm * round.radius_mm - off * off) - round.radius_mm;
      heights.z_um.push_back(static_cast<std::int32_t>(std::lround(1000 * z)));
    }
  }
  recon::Surface made{.kind = Kind::height_map,
                      .air_mm = round.air_mm,
                      .gel_mm = round.gel_mm,
                      .refraction = round.refraction};
  made.heights = std::make_shared<const recon::SurfaceHeights>(std::move(heights));
  return made;
}

}  // namespace dtact::perceive::test
