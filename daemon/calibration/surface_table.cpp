#include "daemon/calibration/surface_table.hpp"

#include <fmt/format.h>

#include "daemon/recon/surface_limits.hpp"

namespace dtact::calibration {
namespace {

using Kind = recon::Surface::Kind;
using Limits = recon::SurfaceLimits;

std::string format_shape(const recon::Surface& surface) {
  if (surface.kind == Kind::sphere) {
    return fmt::format("shape = \"sphere\"\nradius_mm = {}\n", surface.radius_mm);
  }
  return fmt::format(
      "shape = \"cylinder\"\nradius_mm = {}\n"
      "axis_deg = {}  # from the map's x towards its y\n",
      surface.radius_mm, surface.axis_deg);
}

}  // namespace

std::string format_surface(const recon::Surface& surface) {
  if (surface.kind == Kind::plane) return {};
  return fmt::format(
      "{}air_mm = {}  # from the camera's pinhole to the gel's flat back\n"
      "gel_mm = {}  # from there to the surface\n"
      "refraction = {}  # of the gel\n",
      format_shape(surface), surface.air_mm, surface.gel_mm, surface.refraction);
}

recon::Surface read_surface(tomlfile::KeyReader reader) {
  recon::Surface surface;
  if (reader.keys().empty()) return surface;
  const std::string shape = reader.text("shape");
  if (shape == "sphere") {
    surface.kind = Kind::sphere;
  } else if (shape == "cylinder") {
    surface.kind = Kind::cylinder;
  } else {
    reader.fail("shape", "\"" + shape + "\" is not allowed; expected \"sphere\" or \"cylinder\"");
  }
  surface.radius_mm = reader.number("radius_mm", Limits::kLeastRadiusMm, Limits::kMostRadiusMm);
  if (surface.kind == Kind::cylinder) surface.axis_deg = reader.number("axis_deg", -180, 180);
  surface.air_mm = reader.number("air_mm", Limits::kLeastDistanceMm, Limits::kMostDistanceMm);
  surface.gel_mm = reader.number("gel_mm", Limits::kLeastDistanceMm, Limits::kMostDistanceMm);
  surface.refraction = reader.number("refraction", 1, Limits::kMostRefraction);
  reader.finish();
  return surface;
}

}  // namespace dtact::calibration
