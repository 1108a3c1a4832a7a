#pragma once

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "daemon/calibration/calibration.hpp"

namespace dtact::calibration {

/// A calibration that differs from the defaults in every field.
inline Calibration sample() {
  auto model = std::make_shared<recon::Model>();
  model->method = recon::Method::lut;
  model->rectify = recon::make_crop_table(12, 9, 3, 2, 6, 5);  // 108 pixels → 30
  model->mm_per_px = 0.051;
  model->smoothing_px = 1.5;
  model->lut.first_q6 = -2;
  model->lut.um = {-20, -10, 0, 10, 20};
  model->lut.covered_from_q6 = -1;
  model->lut.covered_to_q6 = 2;
  model->reference_q8.assign(108, 160 * 256 + 37);
  model->reference_q8[5] = 65280;
  model->untrusted.assign(30, 0);
  model->untrusted[0] = model->untrusted[7] = model->untrusted[8] = model->untrusted[29] = 1;
  model->uncertainty = {{0.25, 12.5}, {1.1, 20}};
  model->scattering = recon::Scattering{.narrow_mm = 0.28, .wide_mm = 1.23, .narrow_weight = 0.7};
  model->sharpened = {
      {.steps = 1,
       .lut = {.first_q6 = -1, .um = {-9, 0, 9, 18}, .covered_from_q6 = 0, .covered_to_q6 = 1},
       .uncertainty = {{0.5, 15}}},
      {.steps = 2,
       .lut = {.first_q6 = -3, .um = {-8, -4, -1, 0}, .covered_from_q6 = -2, .covered_to_q6 = 0},
       .uncertainty = {}}};
  model->gain = {.shape = recon::GainShape::radial,
                 .centre_x_mm = 1.5,
                 .centre_y_mm = -2,
                 .per_mm = -0.0125,
                 .polynomial = {0.015625, -0.5}};
  model->force = recon::ForceModel{.modulus_mpa = 0.125,
                                   .thickness_mm = 2.25,
                                   .zero_mm = -0.0625,
                                   .error_share = 0.03,
                                   .pairs = 12,
                                   .from_n = 0.1,
                                   .to_n = 2};
  Calibration calibration;
  calibration.gel = {.thickness_mm = {2.1, 0.05},
                     .narrow_mm = {0.28, 0.01},
                     .wide_mm = {1.23, 0.2},
                     .narrow_weight = {0.7, 0.03},
                     .indentation = {-0.24, -0.12, 0, 0.4, 0.8},
                     .slope = {{{1.5, 0.2}, {1, 0.1}, {0.4, 0.01}, {0.5, 0.02}, {0.6, 0.3}}},
                     .bulge_factor = 1.5,
                     .residual_levels = 0.21};
  calibration.crop_col = 3;
  calibration.crop_row = 2;
  calibration.origin.camera = "usb-0:1.2 \"left\"\\";
  calibration.origin.pixel_format = "MJPEG";
  calibration.origin.fps = 59.94;
  calibration.origin.controls = {{"exposure absolute", 157}, {"gain", -3}};
  calibration.origin.leds = {255, 254, 253, 0, 1, 2};
  calibration.origin.created = "2026-01-31T12:00:00Z";
  calibration.origin.sources = {{"ball.png", std::string(64, 'a')},
                                {"ball_reference.png", std::string(64, '0')}};
  calibration.model = std::move(model);
  return calibration;
}

/// A folder of the test's own, removed at the end.
class TempFolder {
 public:
  explicit TempFolder(
      const std::filesystem::path& parent = std::filesystem::temp_directory_path()) {
    std::string name = (parent / "dtact.XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace dtact::calibration
