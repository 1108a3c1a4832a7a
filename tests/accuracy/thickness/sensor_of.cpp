#include "tests/accuracy/thickness/thickness.hpp"

namespace dtact::thickness {

hal::sim::Scene sensor_of(double thickness_mm) {
  constexpr double kFittedMm = 2.0;  // the built-in scene's gel
  hal::sim::Scene scene = hal::sim::default_scene();
  const double scale = thickness_mm / kFittedMm;
  scene.gel.thickness_mm = thickness_mm;
  scene.optics.narrow_mm *= scale;
  scene.optics.wide_mm *= scale;
  scene.optics.pressed_slope /= scale;
  scene.optics.pressed_curve /= scale * scale;
  scene.optics.bulged_slope /= scale;
  scene.optics.bulged_curve /= scale * scale;
  return scene;
}

}  // namespace dtact::thickness
