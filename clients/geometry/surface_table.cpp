#include "clients/geometry/surface_table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dtact::perceive {
namespace {

using Kind = recon::Surface::Kind;

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

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

/// Three values of a table at a place between four pixels, and how they change along a row and
/// along a column, per pixel.
struct Between {
  Vector value = {};
  Vector along_row = {};
  Vector along_column = {};
};

Between between(const SurfaceTable& table, const std::array<std::vector<float>, 3>& parts,
                double column, double row) {
  const int c = std::min(static_cast<int>(column), table.width - 2);
  const int r = std::min(static_cast<int>(row), table.height - 2);
  const double right = column - c;
  const double down = row - r;
  const auto width = static_cast<std::size_t>(table.width);
  const std::size_t i = static_cast<std::size_t>(r) * width + static_cast<std::size_t>(c);
  Between out;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto& part = parts[axis];
    const double above = double{part[i + 1]} - double{part[i]};
    const double below = double{part[i + width + 1]} - double{part[i + width]};
    const double left_down = double{part[i + width]} - double{part[i]};
    out.along_row[axis] = above + down * (below - above);
    out.along_column[axis] = left_down + right * (below - above);
    out.value[axis] = double{part[i]} + right * above + down * out.along_column[axis];
  }
  return out;
}

/// Where a ray in the gel leaves a sphere or a cylinder.
std::optional<SurfacePoint> leave_round(const recon::Surface& surface, const Vector& entry,
                                        const Vector& direction) {
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
  const Vector normal{out[0] / surface.radius_mm, out[1] / surface.radius_mm,
                      out[2] / surface.radius_mm};
  const double upright = dot(direction, normal);
  return SurfacePoint{{at[0] * kMetre, at[1] * kMetre, at[2] * kMetre},
                      normal,
                      {direction[0] / upright, direction[1] / upright, direction[2] / upright}};
}

}  // namespace

std::optional<SurfacePoint> cast_ray(const recon::Surface& surface, double x_mm, double y_mm) {
  if (surface.kind == Kind::plane) {
    const recon::Viewpoint& view = surface.view;
    return SurfacePoint{
        {x_mm * kMetre, y_mm * kMetre, 0},
        {0, 0, 1},
        {(x_mm - view.foot_mm.x) * view.per_mm, (y_mm - view.foot_mm.y) * view.per_mm, 1}};
  }
  const double radius = std::hypot(x_mm, y_mm);
  const double inwards = radius > 0 ? entry_radius(surface, radius) / radius : 0;
  const Vector entry{inwards * x_mm, inwards * y_mm, -surface.gel_mm};
  const Vector direction{x_mm - entry[0], y_mm - entry[1], surface.gel_mm};
  return leave_round(surface, entry, direction);
}

SurfaceTable make_surface_table(const recon::Surface& surface, int width, int height,
                                double mm_per_px) {
  SurfaceTable table{width, height, mm_per_px, {}, {}, {}};
  const auto size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  for (auto* part : {&table.point, &table.normal, &table.ray}) {
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
        table.ray[i][pixel] = static_cast<float>(found->ray[i]);
      }
    }
  }
  return table;
}

std::optional<SurfaceProjection> project_to_surface(const SurfaceTable& table,
                                                    const Vector& point) {
  if (table.width < 2 || table.height < 2) return std::nullopt;
  if (std::isnan(point[0]) || std::isnan(point[1]) || std::isnan(point[2])) return std::nullopt;
  const double last_column = table.width - 1;
  const double last_row = table.height - 1;
  const double px = table.mm_per_px * kMetre;
  // A ray spreads on its way to z = 0, so that this lies nearer to the middle than the foot.
  double column = point[0] / px + last_column / 2;
  double row = point[1] / px + last_row / 2;
  // Gauss-Newton on the distance: the error of a step is that of the one before times the point's
  // distance over the surface's radius.
  constexpr int kMaxSteps = 8;
  constexpr double kClose = 0.02;
  for (int step = 0; step < kMaxSteps; ++step) {
    const double c = std::clamp(column, 0.0, last_column);
    const double r = std::clamp(row, 0.0, last_row);
    const Between at = between(table, table.point, c, r);
    const Vector normal = between(table, table.normal, c, r).value;
    const Vector ray = between(table, table.ray, c, r).value;
    // What lies beside the ray, along the surface: the table's steps are chords, which lean.
    Vector off = along(point, -1, at.value);
    off = along(off, -dot(off, normal) / dot(ray, normal), ray);
    const double cc = dot(at.along_row, at.along_row);
    const double cr = dot(at.along_row, at.along_column);
    const double rr = dot(at.along_column, at.along_column);
    const double to_right = dot(at.along_row, off);
    const double to_below = dot(at.along_column, off);
    const double determinant = cc * rr - cr * cr;
    if (!(determinant > 0)) return std::nullopt;  // NaN too
    column = c + (rr * to_right - cr * to_below) / determinant;
    row = r + (cc * to_below - cr * to_right) / determinant;
    if (std::max(std::abs(column - c), std::abs(row - r)) >= kClose) continue;
    if (column < 0 || row < 0 || column > last_column || row > last_row) return std::nullopt;
    return SurfaceProjection{column, row, normal};
  }
  return std::nullopt;
}

}  // namespace dtact::perceive
