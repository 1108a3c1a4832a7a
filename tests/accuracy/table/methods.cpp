#include "tests/accuracy/table/methods.hpp"

#include <array>
#include <string>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"
#include "clients/calibrate/fit/model/model_build.hpp"

namespace dtact::table {
namespace {

std::shared_ptr<const recon::Model> from_one(const Material& material, recon::Method method) {
  calibration::BallPress press;
  press.reference_q8 = material.reference_q8;
  press.frames = material.centre;
  press.ball_radius_mm = material.trial->centre.radius_mm;
  press.mm_per_px = kMmPerPx;
  press.view = material.view;
  press.crop = calibration::Crop{kCropCol, kCropRow, kCrop, kCrop};
  press.method = method;
  press.may_share_light = true;
  return calibration::build(press).model;
}

std::shared_ptr<const recon::Model> published_single(const Material& material) {
  return from_one(material, recon::Method::published);
}

calibration::BallPresses no_presses(const Material& material) {
  calibration::BallPresses set;
  set.reference_q8 = material.reference_q8;
  set.ball_radius_mm = material.trial->centre.radius_mm;
  set.mm_per_px = kMmPerPx;
  set.view = material.view;
  set.crop = calibration::Crop{kCropCol, kCropRow, kCrop, kCrop};
  return set;
}

calibration::BallPresses many_presses(const Material& material) {
  calibration::BallPresses set = no_presses(material);
  for (std::size_t i = 0; i < material.many.size(); ++i) {
    set.presses.push_back(
        {.name = "press " + std::to_string(i + 1), .frames = material.many[i], .depth_mm = {}});
  }
  return set;
}

calibration::BallPresses centre_press(const Material& material) {
  calibration::BallPresses set = no_presses(material);
  set.presses.push_back({.name = "centre", .frames = material.centre, .depth_mm = {}});
  return set;
}

std::shared_ptr<const recon::Model> gel_model(const Material& material) {
  return calibration::build_model(centre_press(material)).calibration.model;
}

std::shared_ptr<const recon::Model> published_regression(const Material& material) {
  const RegressionCentre& centre = material.regression_centre;
  return calibration::build_regression(many_presses(material), centre.right_mm, centre.down_mm)
      .model;
}

constexpr std::array<Method, 7> kMethods = {{
    {"published single image", published_single},
    {"published regression", published_regression, 0, true},
    {"sphere alone, one press", alone_single},
    {"sphere alone, many presses", [](const Material& material) { return alone_many(material); }, 0,
     true},
    {"ours, one press", ours_single},
    {"ours, many presses", ours_many, 0, true},
    {"ours, gel model of one press, sharpened", gel_model, 2},
}};

}  // namespace

Material gather(Sensor& sensor, const Trial& trial, const RegressionCentre& centre) {
  Material material;
  material.trial = &trial;
  material.regression_centre = centre;
  material.view = view_of(sensor.truth().scene());
  material.reference_q8 = sensor.reference(kReferenceFrames);
  material.centre = sensor.press(0, kPressFrames);
  for (std::size_t i = 0; i < trial.many.size(); ++i) {
    material.many.push_back(sensor.press(1 + i, kPressFrames));
  }
  return material;
}

std::shared_ptr<const recon::Model> alone_single(const Material& material) {
  return from_one(material, recon::Method::lut);
}

std::shared_ptr<const recon::Model> alone_many(const Material& material,
                                               calibration::PressReport* report) {
  return calibration::build(many_presses(material), report).model;
}

std::shared_ptr<const recon::Model> ours_single(const Material& material) {
  calibration::PressReport report;
  return calibration::build_auto(centre_press(material), {}, report).model;
}

std::shared_ptr<const recon::Model> ours_many(const Material& material) {
  calibration::PressReport report;
  return calibration::build_auto(many_presses(material), {}, report).model;
}

std::span<const Method> methods() { return kMethods; }

}  // namespace dtact::table
