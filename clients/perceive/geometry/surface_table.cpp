#include "clients/perceive/geometry/surface_table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dtact::perceive {
namespace {

constexpr double kMetre = 1e-3;  // of a millimetre

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector along(const Vector& from, double t, const Vector& direction) {
  return {from[0] + t * direction[0], from[1] + t * direction[1], from[2] + t * direction[2]};
}

/// How far from the axis the ray enters the gel that crosses z = 0 at `radius`: sin(in air) =
/// refraction · sin(in the gel), whose difference falls with the place of entry.
double entry_radius(const recon::Surface& surface, double radius) {
  if (surface.refraction == 1) return radius * surface.air_mm / (surface.air_mm + surface.gel_mm);
  double low = 0;
  double high = radius;
  constexpr int kHalvings = 50;  // to 1e-15 of the radius
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    const double in_air = middle / std::hypot(middle, surface.air_mm);
    const double in_gel = (radius - middle) / std::hypot(radius - middle, surface.gel_mm);
    (surface.refraction * in_gel > in_air ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

std::optional<SurfacePoint> cast_ray(const recon::Surface& surface, double x_mm, double y_mm) {
  using Kind = recon::Surface::Kind;
  if (surface.kind == Kind::plane) {
    return SurfacePoint{{x_mm * kMetre, y_mm * kMetre, 0}, {0, 0, 1}};
  }
  const double radius = std::hypot(x_mm, y_mm);
  const double inwards = radius > 0 ? entry_radius(surface, radius) / radius : 0;
  const Vector entry{inwards * x_mm, inwards * y_mm, -surface.gel_mm};
  const Vector direction{x_mm - entry[0], y_mm - entry[1], surface.gel_mm};
  // |p + t d| = radius, both seen from the centre; of a cylinder without what lies along its axis.
  Vector p{entry[0], entry[1], entry[2] + surface.radius_mm};
  Vector d = direction;
  if (surface.kind == Kind::cylinder) {
    const double angle = surface.axis_deg * std::numbers::pi / 180;
    const Vector axis{std::cos(angle), std::sin(angle), 0};
    p = along(p, -dot(p, axis), axis);
    d = along(d, -dot(d, axis), axis);
  }
  const double a = dot(d, d);
  const double b = dot(p, d);
  const double c = dot(p, p) - surface.radius_mm * surface.radius_mm;
  const double root = b * b - a * c;
  if (a == 0 || root < 0) return std::nullopt;
  // The farther one: there the ray leaves the gel.
  const double t = (-b + std::sqrt(root)) / a;
  if (t <= 0) return std::nullopt;
  const Vector at = along(entry, t, direction);
  const Vector out = along(p, t, d);
  return SurfacePoint{
      {at[0] * kMetre, at[1] * kMetre, at[2] * kMetre},
      {out[0] / surface.radius_mm, out[1] / surface.radius_mm, out[2] / surface.radius_mm}};
}

SurfaceTable make_surface_table(const recon::Surface& surface, int width, int height,
                                double mm_per_px) {
  SurfaceTable table{width, height, {}, {}};
  const auto size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  for (auto* part : {&table.point, &table.normal}) {
    for (auto& values : *part) values.assign(size, std::numeric_limits<float>::quiet_NaN());
  }
  std::size_t pixel = 0;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column, ++pixel) {
      const auto found = cast_ray(surface, (column - 0.5 * (width - 1)) * mm_per_px,
                                  (row - 0.5 * (height - 1)) * mm_per_px);
      if (!found) continue;
      for (std::size_t i = 0; i < 3; ++i) {
        table.point[i][pixel] = static_cast<float>(found->point[i]);
        table.normal[i][pixel] = static_cast<float>(found->normal[i]);
      }
    }
  }
  return table;
}

}  // namespace dtact::perceive
