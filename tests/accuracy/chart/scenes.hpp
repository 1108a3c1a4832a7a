#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"
#include "hal/sim/renderer.hpp"

/// The chart's scenes: the built-in simulated sensor (hal/sim), whose truth the methods never see.
/// Depth is measured on the paper's crop: 580×580 of 800×600 pixels, 24×24 mm.
namespace dtact::chart {

inline constexpr int kWidth = 800;   ///< Pixels of a frame.
inline constexpr int kHeight = 600;  ///< Pixels of a frame.
inline constexpr int kSide = 580;    ///< Pixels of the crop, both ways.
inline constexpr int kCropCol = (kWidth - kSide) / 2;
inline constexpr int kCropRow = (kHeight - kSide) / 2;
inline constexpr double kMmPerPx = 0.0413793;
/// The simulated camera's place, as its drawing would say it.
inline constexpr calibration::CameraView kView{
    .foot_mm = {}, .source = calibration::HeightSource::drawing, .per_mm = 1.0 / 28};

/// An object at rest on the sensor.
struct Shot {
  std::string name;                  ///< "ball", "screws", "flat", "nothing".
  std::vector<image::Grey8> frames;  ///< The same moment; only the noise differs.
  std::vector<float> truth_mm;       ///< Indentation at every pixel of the crop, row-major.
  /// Where the error counts: true contact, everywhere without contact. Row-major, crop sized.
  std::vector<std::uint8_t> judged;
};

/// The truth of one frame, without frames.
[[nodiscard]] Shot truth_of(const hal::sim::Renderer& renderer, std::uint64_t sequence);

/// The sensor without contact: the mean of many frames, Q8.
[[nodiscard]] image::Grey16 make_reference();

/// The press that calibrates: a ball of 4 mm radius, 1.3 mm deep near the centre.
[[nodiscard]] Shot make_calibration_press();

/// The presses for methods that need several: the same ball at eleven places, 0.4 to 1.4 mm
/// deep.
[[nodiscard]] std::vector<Shot> make_calibration_presses();

/// A ball of 5 mm radius 1.2 mm deep, three set screws 0.8 mm deep, a flat disc that covers most of
/// the field 0.25 mm deep, nothing.
[[nodiscard]] std::vector<Shot> make_shots();

/// A scene file's body with one press that rests from 0.5 s on.
[[nodiscard]] Shot shoot(const std::string& name, const std::string& press_toml, int frames);

}  // namespace dtact::chart
