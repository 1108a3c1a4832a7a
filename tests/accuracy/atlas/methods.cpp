#include "tests/accuracy/atlas/methods.hpp"

#include <utility>

#include "tests/accuracy/table/methods.hpp"

namespace dtact::atlas {

const std::vector<Method>& methods() {
  static const std::vector<Method> calibrated = [] {
    const table::Trial trial = table::draw(1);
    table::Sensor sensor(table::solve(hal::sim::default_scene(), trial.all()),
                         table::configurations()[0], trial.seed);
    const table::Material material = table::gather(sensor, trial, {});
    std::vector<Method> all;
    for (const table::Method& method : table::methods()) {
      calibration::Calibration calibration;
      calibration.name = method.name;
      calibration.model = method.calibrate(material);
      calibration.crop_col = table::kCropCol;
      calibration.crop_row = table::kCropRow;
      all.push_back({method.name,
                     std::make_shared<const calibration::Calibration>(std::move(calibration)),
                     method.sharpen_steps});
    }
    return all;
  }();
  return calibrated;
}

}  // namespace dtact::atlas
