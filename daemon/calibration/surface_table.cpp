#include "daemon/calibration/surface_table.hpp"

#include <fmt/format.h>

namespace dtact::calibration {

using Kind = recon::Surface::Kind;

std::string format_surface(const recon::Surface& surface) {
  if (surface.kind == Kind::plane) return {};
  const bool cylinder = surface.kind == Kind::cylinder;
  return fmt::format(
      "shape = \"{}\"\nradius_mm = {}\n{}"
      "air_mm = {}  # from the camera's pinhole to the gel's flat back\n"
      "gel_mm = {}  # from there to the surface\n"
      "refraction = {}  # of the gel\n",
      cylinder ? "cylinder" : "sphere", surface.radius_mm,
      cylinder ? fmt::format("axis_deg = {}  # from the map's x towards its y\n", surface.axis_deg)
               : "",
      surface.air_mm, surface.gel_mm, surface.refraction);
}

recon::Surface read_surface(tomlfile::KeyReader reader) {
  recon::Surface surface;
  if (reader.keys().empty()) return surface;
  const std::string shape = reader.text("shape");
  if (shape != "sphere" && shape != "cylinder") {
    reader.fail("shape", "\"" + shape + "\" is not allowed; expected \"sphere\" or \"cylinder\"");
  }
  surface.kind = shape == "sphere" ? Kind::sphere : Kind::cylinder;
  surface.radius_mm = reader.number("radius_mm", 1, 10000);
  if (surface.kind == Kind::cylinder) surface.axis_deg = reader.number("axis_deg", -180, 180);
  surface.air_mm = reader.number("air_mm", 0.01, 1000);
  surface.gel_mm = reader.number("gel_mm", 0.01, 1000);
  surface.refraction = reader.number("refraction", 1, 3);
  reader.finish();
  return surface;
}

}  // namespace dtact::calibration
