#include "clients/common/depth_message.hpp"

#include <fmt/format.h>

#include <cstdint>

#include "clients/cpp/errors.hpp"
#include "clients/cpp/maps.hpp"
#include "daemon/recon/rectify.hpp"
#include "daemon/recon/surface.hpp"

namespace dtact::cli {
namespace {

using Kind = recon::Surface::Kind;
using Limits = recon::SurfaceLimits;

[[noreturn]] void refuse(const std::string& what) {
  throw client::ProtocolError(
      fmt::format("a surface {}: install the same release on both sides", what));
}

Kind kind_of(v1::Surface::Shape shape) {
  switch (shape) {
    case v1::Surface::PLANE:
      return Kind::plane;
    case v1::Surface::SPHERE:
      return Kind::sphere;
    case v1::Surface::CYLINDER:
      return Kind::cylinder;
    default:
      refuse(fmt::format("has a shape, {}, that is not known here", static_cast<int>(shape)));
  }
}

/// False for NaN.
bool within(double value, double low, double high) { return value >= low && value <= high; }

/// Throws ProtocolError unless the map lies in its whole, which is no larger than a daemon's, and
/// its scales are those that a calibration can have.
void require_possible(const v1::DepthMap& map) {
  const std::uint64_t full_width = map.full_width();
  const std::uint64_t full_height = map.full_height();
  const bool placed = std::uint64_t{map.x()} + map.width() <= full_width &&
                      std::uint64_t{map.y()} + map.height() <= full_height &&
                      full_width * full_height <= std::uint64_t{recon::kMaxMapPixels};
  // A calibration has 0.0001 to 10 mm a pixel.
  constexpr std::uint32_t kMaxDecimation = 64;
  const bool scaled = within(map.mm_per_px(), 1e-4, 10.0 * kMaxDecimation) &&
                      within(map.um_per_unit(), 1e-3, 1e3) && map.decimation() <= kMaxDecimation;
  if (placed && scaled) return;
  throw client::ProtocolError(
      fmt::format("a depth map of {}x{} pixels at {}, {} of {}x{}, {} mm a pixel, {} um a unit and "
                  "decimation {} contradicts itself: install the same release on both sides",
                  map.width(), map.height(), map.x(), map.y(), map.full_width(), map.full_height(),
                  map.mm_per_px(), map.um_per_unit(), map.decimation()));
}

}  // namespace

recon::Surface surface_of(const v1::Surface& surface) {
  recon::Surface made;
  made.kind = kind_of(surface.shape());
  if (made.kind == Kind::plane) {
    made.view = {{surface.foot_x_mm(), surface.foot_y_mm()}, surface.per_mm()};
    if (!within(made.view.per_mm, 0, Limits::kMaxPerMm) ||
        !within(made.view.foot_mm.x, -Limits::kMaxFootMm, Limits::kMaxFootMm) ||
        !within(made.view.foot_mm.y, -Limits::kMaxFootMm, Limits::kMaxFootMm)) {
      refuse(fmt::format("seen from above {}, {} mm with {} for each mm of height cannot be",
                         surface.foot_x_mm(), surface.foot_y_mm(), surface.per_mm()));
    }
    return made;
  }
  made.air_mm = surface.air_mm();
  made.gel_mm = surface.gel_mm();
  made.refraction = surface.refraction();
  made.radius_mm = surface.radius_mm();
  made.axis_deg = surface.axis_deg();
  if (!within(made.air_mm, Limits::kMinDistanceMm, Limits::kMaxDistanceMm) ||
      !within(made.gel_mm, Limits::kMinDistanceMm, Limits::kMaxDistanceMm) ||
      !within(made.refraction, 1, Limits::kMaxRefraction) ||
      !within(made.radius_mm, Limits::kMinRadiusMm, Limits::kMaxRadiusMm) ||
      !within(made.axis_deg, -180, 180)) {
    refuse(fmt::format(
        "of {} mm radius, its axis at {} degrees, behind {} mm of air and {} mm of "
        "gel of index {} cannot be",
        surface.radius_mm(), surface.axis_deg(), made.air_mm, made.gel_mm, made.refraction));
  }
  return made;
}

void set_surface(const recon::Surface& surface, v1::Frame& frame) {
  frame.clear_surface();
  if (surface == recon::Surface{}) return;
  v1::Surface& out = *frame.mutable_surface();
  out.set_shape(surface.kind == Kind::plane    ? v1::Surface::PLANE
                : surface.kind == Kind::sphere ? v1::Surface::SPHERE
                                               : v1::Surface::CYLINDER);
  out.set_radius_mm(surface.radius_mm);
  out.set_axis_deg(surface.axis_deg);
  out.set_air_mm(surface.air_mm);
  out.set_gel_mm(surface.gel_mm);
  out.set_refraction(surface.refraction);
  out.set_foot_x_mm(surface.view.foot_mm.x);
  out.set_foot_y_mm(surface.view.foot_mm.y);
  out.set_per_mm(surface.view.per_mm);
}

std::vector<std::int16_t> depths_of(const v1::DepthMap& map) {
  require_possible(map);
  return client::values_of(map);
}

perceive::DepthGrid grid_of(const v1::DepthMap& map, std::span<const std::int16_t> values) {
  return {.x = static_cast<int>(map.x()),
          .y = static_cast<int>(map.y()),
          .width = static_cast<int>(map.width()),
          .height = static_cast<int>(map.height()),
          .full_width = static_cast<int>(map.full_width()),
          .full_height = static_cast<int>(map.full_height()),
          .mm_per_px = map.mm_per_px(),
          .um_per_unit = map.um_per_unit(),
          .untrusted = map.untrusted_value(),
          .values = values};
}

DepthImage depth_image(const v1::Frame& frame, std::span<const float> mm) {
  const v1::DepthMap& map = frame.depth();
  require_possible(map);
  return {.width = static_cast<int>(map.width()),
          .height = static_cast<int>(map.height()),
          .mm_per_px = map.mm_per_px(),
          .mm = mm,
          .x = static_cast<int>(map.x()),
          .y = static_cast<int>(map.y()),
          .full_width = static_cast<int>(map.full_width()),
          .full_height = static_cast<int>(map.full_height()),
          .surface = surface_of(frame.surface())};
}

}  // namespace dtact::cli
