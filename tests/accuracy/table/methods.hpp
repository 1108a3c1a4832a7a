#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/recon/model.hpp"
#include "hal/files/png.hpp"
#include "tests/accuracy/table/sensor.hpp"
#include "tests/accuracy/table/trial.hpp"

namespace dtact::table {

/// The images from which a calibration is made.
struct Material {
  const Trial* trial = nullptr;  ///< For the balls' radii.
  RegressionCentre regression_centre;
  calibration::CameraView view;
  image::Grey16 reference_q8;
  std::vector<image::Grey8> centre;             ///< The press near the centre.
  std::vector<std::vector<image::Grey8>> many;  ///< The presses anywhere.
};

/// "We average images within a small time window": the number of images for each press, and for the
/// reference.
inline constexpr std::size_t kPressFrames = 8;
inline constexpr std::size_t kReferenceFrames = 32;

[[nodiscard]] Material gather(Sensor& sensor, const Trial& trial, const RegressionCentre& centre);

/// LUTs from the known sphere only: from the press near the centre, and from those anywhere.
[[nodiscard]] std::shared_ptr<const recon::Model> alone_single(const Material& material);
[[nodiscard]] std::shared_ptr<const recon::Model> alone_many(
    const Material& material, calibration::PressReport* report = nullptr);
/// Calibrations of dtact-calibrate's default method.
[[nodiscard]] std::shared_ptr<const recon::Model> ours_single(const Material& material);
[[nodiscard]] std::shared_ptr<const recon::Model> ours_many(const Material& material);

/// A row of the table.
struct Method {
  std::string_view name;
  std::shared_ptr<const recon::Model> (*calibrate)(const Material& material) = nullptr;
  int sharpen_steps = 0;
  bool of_many = false;  ///< Needs presses besides the one near the centre.
};

[[nodiscard]] std::span<const Method> methods();

}  // namespace dtact::table
