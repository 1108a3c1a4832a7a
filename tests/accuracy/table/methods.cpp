#include "tests/accuracy/table/methods.hpp"

#include <array>

#include "daemon/calibration/build.hpp"

namespace dtact::table {
namespace {

std::shared_ptr<const recon::Model> from_one(const Material& material, recon::Method method) {
  calibration::BallPress press;
  press.reference_q8 = material.reference_q8;
  press.frames = material.centre;
  press.ball_radius_mm = material.trial->centre.radius_mm;
  press.mm_per_px = kMmPerPx;
  press.crop = calibration::Crop{kCropCol, kCropRow, kCrop, kCrop};
  press.method = method;
  return calibration::build(press).model;
}

std::shared_ptr<const recon::Model> published_single(const Material& material) {
  return from_one(material, recon::Method::published);
}

std::shared_ptr<const recon::Model> ours_single(const Material& material) {
  return from_one(material, recon::Method::list);
}

constexpr std::array<Method, 2> kMethods = {{
    {"published single image", published_single},
    {"ours, one press", ours_single},
}};

}  // namespace

Material gather(Sensor& sensor, const Trial& trial) {
  Material material;
  material.trial = &trial;
  material.reference_q8 = sensor.reference(kReferenceFrames);
  material.centre = sensor.press(0, kPressFrames);
  for (std::size_t i = 0; i < trial.many.size(); ++i) {
    material.many.push_back(sensor.press(1 + i, kPressFrames));
  }
  return material;
}

std::span<const Method> methods() { return kMethods; }

}  // namespace dtact::table
