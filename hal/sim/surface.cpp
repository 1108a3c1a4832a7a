#include "hal/sim/surface.hpp"

#include <cmath>
#include <numbers>

namespace dtact::hal::sim {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

// From the camera, at height R − D over the centre of a circle of radius R, along (across, up) per
// unit: how many units until the circle. The camera lies inside of it.
double units_to_circle(double radius, double from_centre, double across, double up) noexcept {
  const double a = across * across + up * up;
  const double b = from_centre * up;
  const double c = from_centre * from_centre - radius * radius;
  return (-b + std::sqrt(b * b - a * c)) / a;
}

}  // namespace

Place unrolled(const SurfaceModel& surface, const Place& seen, double depth_mm) noexcept {
  const double radius = surface.radius_mm;
  const double camera = surface.camera_mm;
  const double from_centre = radius - camera;
  const double pressed = radius - depth_mm;
  switch (surface.shape) {
    case SurfaceShape::plane: {
      const double rest = camera > 0 ? 1 - depth_mm / camera : 1;
      return {rest * seen.x_mm, rest * seen.y_mm};
    }
    case SurfaceShape::sphere: {
      const double across = std::hypot(seen.x_mm, seen.y_mm);
      if (across == 0) break;
      const double t = units_to_circle(pressed, from_centre, across, camera);
      const double arc = radius * std::atan2(t * across, from_centre + t * camera);
      return {seen.x_mm * arc / across, seen.y_mm * arc / across};
    }
    case SurfaceShape::cylinder: {
      const double t = units_to_circle(pressed, from_centre, seen.y_mm, camera);
      return {t * seen.x_mm, radius * std::atan2(t * seen.y_mm, from_centre + t * camera)};
    }
  }
  return seen;
}

SurfacePoint point_at(const SurfaceModel& surface, const Place& place) {
  const double radius = surface.radius_mm;
  if (surface.shape == SurfaceShape::plane) return {{place.x_mm, place.y_mm, 0}, {0, 0, 1}, {}};
  const double along = surface.shape == SurfaceShape::cylinder ? place.x_mm : 0;
  const double arc_x = place.x_mm - along;
  const double arc = std::hypot(arc_x, place.y_mm);
  if (arc == 0) return {{along, 0, 0}, {0, 0, 1}, {}};
  const double angle = arc / radius;
  const cv::Vec3d normal(std::sin(angle) * arc_x / arc, std::sin(angle) * place.y_mm / arc,
                         std::cos(angle));
  const cv::Vec3d centre(along, 0, -radius);
  return {centre + radius * normal,
          normal,
          {-place.y_mm / radius * kDegrees, arc_x / radius * kDegrees, 0}};
}

}  // namespace dtact::hal::sim
