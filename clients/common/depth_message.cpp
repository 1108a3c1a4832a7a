#include "clients/common/depth_message.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

#include "clients/cpp/errors.hpp"
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

}  // namespace

recon::Surface surface_of(const v1::Surface& surface) {
  recon::Surface made;
  made.kind = kind_of(surface.shape());
  if (made.kind == Kind::plane) return made;
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

DepthImage depth_image(const v1::Frame& frame, std::span<const float> mm) {
  const v1::DepthMap& map = frame.depth();
  const std::uint64_t full_width = map.full_width();
  const std::uint64_t full_height = map.full_height();
  constexpr std::uint64_t kMaxSide = 1U << 20U;
  if (std::uint64_t{map.x()} + map.width() > full_width ||
      std::uint64_t{map.y()} + map.height() > full_height || full_width > kMaxSide ||
      full_height > kMaxSide) {
    throw client::ProtocolError(
        fmt::format("a depth map of {}x{} pixels at {}, {} of {}x{} contradicts itself: install "
                    "the same release on both sides",
                    map.width(), map.height(), map.x(), map.y(), full_width, full_height));
  }
  return {.width = static_cast<int>(map.width()),
          .height = static_cast<int>(map.height()),
          .mm_per_px = map.mm_per_px(),
          .mm = mm,
          .x = static_cast<int>(map.x()),
          .y = static_cast<int>(map.y()),
          .full_width = static_cast<int>(full_width),
          .full_height = static_cast<int>(full_height),
          .surface = surface_of(frame.surface())};
}

}  // namespace dtact::cli
