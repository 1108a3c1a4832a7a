#include "tests/accuracy/atlas/methods.hpp"

#include <algorithm>
#include <utility>

#include "tests/accuracy/table/methods.hpp"

namespace dtact::atlas {
namespace {

table::Material gather(const table::Trial& trial) {
  table::Sensor sensor(table::solve(hal::sim::default_scene(), trial.all()),
                       table::configurations()[0], trial.seed);
  return table::gather(sensor, trial, {});
}

Method calibrate(const table::Method& method, const table::Material& material) {
  calibration::Calibration calibration;
  calibration.name = method.name;
  calibration.model = method.calibrate(material);
  calibration.crop_col = table::kCropCol;
  calibration.crop_row = table::kCropRow;
  return {method.name, std::make_shared<const calibration::Calibration>(std::move(calibration)),
          method.sharpen_steps};
}

}  // namespace

const std::vector<Method>& methods() {
  static const std::vector<Method> calibrated = [] {
    const table::Trial trial = table::draw(1);
    const table::Material material = gather(trial);
    std::vector<Method> all;
    for (const table::Method& method : table::methods()) all.push_back(calibrate(method, material));
    return all;
  }();
  return calibrated;
}

const Method& alone_single() {
  static const Method calibrated = [] {
    // The press near the centre is drawn first: it is that of methods().
    const table::Trial trial = table::draw(1, {.calibration_presses = 0, .test_presses = 0});
    return calibrate(
        *std::ranges::find(table::methods(), "sphere alone, one press", &table::Method::name),
        gather(trial));
  }();
  return calibrated;
}

}  // namespace dtact::atlas
