#include "tests/accuracy/table/methods.hpp"

#include <array>

#include "daemon/calibration/build.hpp"
#include "tests/accuracy/table/regression.hpp"

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

std::shared_ptr<const recon::Model> published_regression(const Material& material) {
  const RegressionCentre& centre = material.regression_centre;
  return fit_regression(material, centre.right_mm, centre.down_mm);
}

std::shared_ptr<const recon::Model> ours_single(const Material& material) {
  return from_one(material, recon::Method::list);
}

constexpr std::array<Method, 3> kMethods = {{
    {"published single image", published_single},
    {"published linear regression", published_regression},
    {"ours, one press", ours_single},
}};

}  // namespace

Material gather(Sensor& sensor, const Trial& trial, const RegressionCentre& centre) {
  Material material;
  material.trial = &trial;
  material.regression_centre = centre;
  material.reference_q8 = sensor.reference(kReferenceFrames);
  material.centre = sensor.press(0, kPressFrames);
  for (std::size_t i = 0; i < trial.many.size(); ++i) {
    material.many.push_back(sensor.press(1 + i, kPressFrames));
  }
  return material;
}

std::span<const Method> methods() { return kMethods; }

}  // namespace dtact::table
