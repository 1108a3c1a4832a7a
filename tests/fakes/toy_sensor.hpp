#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "daemon/recon/model.hpp"
#include "hal/frame.hpp"

namespace dtact::fakes {

/// A simple sensor for computing by hand: 160×120 pixels of 0.2 mm, 31.25 grey levels a
/// millimetre (2 levels in 64 µm), a press that is a dark spot with a bright ring around it.
struct ToyScene {
  double light = 1;     ///< Factor on the calibration's light.
  double tilt = 0;      ///< Light from the right: 1 + tilt at the right edge, 1 − tilt at the left.
  double press_mm = 0;  ///< Indentation in the middle of the press.
  double x_px = 80;     ///< Its position.
  double y_px = 60;
  double marks = 0;    ///< Height of the gel's marks, grey levels.
  int marks_px = 0;    ///< Their shift to the right since calibration.
  double covered = 0;  ///< Share of its light that the left quarter loses.
};

inline constexpr int kToyWidth = 160;
inline constexpr int kToyHeight = 120;
inline constexpr double kToyMmPerPx = 0.2;

/// −1 … 1, and coarse enough that eight bits show it where it is two levels high.
inline double toy_mark(int x, int y) {
  const auto hash = [](int u, int v) {
    auto h =
        static_cast<std::uint32_t>(u) * 0x9E3779B1U + static_cast<std::uint32_t>(v) * 0x85EBCA77U;
    h = (h ^ (h >> 15U)) * 0x2C1B3C6DU;
    return static_cast<double>((h ^ (h >> 12U)) & 255U) / 128 - 1;
  };
  return hash((x + 100) / 2, y / 2);  // never negative
}

/// Grey level at a pixel, with its fraction.
inline double toy_grey(const ToyScene& scene, int x, int y) {
  const double u = (x - 80) / 80.0;
  const double v = (y - 60) / 80.0;
  const double undeformed = 150 * (1 - 0.2 * (u * u + v * v));
  const double r = std::hypot(x - scene.x_px, y - scene.y_px);
  const double spot = std::exp(-(r / 12) * (r / 12));
  const double ring = std::exp(-((r - 24) / 6) * ((r - 24) / 6));
  const double pressed = undeformed - scene.press_mm * (31.25 * spot - 8 * ring);
  const double mark = scene.marks == 0 ? 0 : scene.marks * toy_mark(x - scene.marks_px, y);
  const double left = x < kToyWidth / 4 ? 1 - scene.covered : 1;
  return (pressed + mark) * left * scene.light * (1 + scene.tilt * u);
}

/// One frame, rows of kToyWidth bytes. Rounded after adding −0.5 … 0.5, which differs from frame to
/// frame, so that averages keep the fraction.
inline void toy_paint(const ToyScene& scene, std::uint64_t sequence, std::uint8_t* out) {
  std::uint64_t state = (sequence + 1) * 0x9E3779B97F4A7C15U;
  state ^= state >> 29U;
  for (int y = 0; y < kToyHeight; ++y) {
    for (int x = 0; x < kToyWidth; ++x) {
      state = state * 6364136223846793005U + 1442695040888963407U;
      const double dither = static_cast<double>(state >> 40U) / 16777216.0 - 0.5;
      const double grey = toy_grey(scene, x, y) + dither;
      *out++ = static_cast<std::uint8_t>(std::fmin(255, std::fmax(0, std::round(grey))));
    }
  }
}

struct ToyFrame {
  explicit ToyFrame(const ToyScene& scene, std::uint64_t sequence = 0)
      : pixels(std::size_t{kToyWidth} * kToyHeight + hal::kLumaPadding) {
    toy_paint(scene, sequence, pixels.data());
  }
  [[nodiscard]] hal::LumaView view() const {
    return {pixels.data(), kToyWidth, kToyHeight, kToyWidth};
  }
  std::vector<std::uint8_t> pixels;
};

inline std::vector<std::uint16_t> toy_reference_q8(const ToyScene& scene = {}) {
  std::vector<std::uint16_t> q8;
  for (int y = 0; y < kToyHeight; ++y) {
    for (int x = 0; x < kToyWidth; ++x) {
      q8.push_back(static_cast<std::uint16_t>(std::lround(256 * toy_grey(scene, x, y))));
    }
  }
  return q8;
}

/// The toy's calibration, made under full white light: the whole frame but eight pixels on each
/// side, or the left `width` pixels of that.
inline std::shared_ptr<calibration::Calibration> toy_calibration(const ToyScene& undeformed = {},
                                                                 int width = kToyWidth - 16) {
  auto model = std::make_shared<recon::Model>();
  model->rectify = recon::make_crop_table(kToyWidth, kToyHeight, 8, 8, width, 104);
  model->mm_per_px = kToyMmPerPx;
  model->smoothing_px = 1;
  model->lut.first_q6 = -40 * 64;
  model->lut.covered_from_q6 = -40 * 64;
  model->lut.covered_to_q6 = 70 * 64;
  // 1/31.25 mm a grey level: half a micrometre an entry.
  for (int q6 = -40 * 64; q6 <= 110 * 64; ++q6) {
    model->lut.um.push_back(static_cast<std::int16_t>(q6 / 2));
  }
  model->reference_q8 = toy_reference_q8(undeformed);
  auto made = std::make_shared<calibration::Calibration>();
  made->name = "toy";
  made->crop_col = 8;
  made->crop_row = 8;
  made->origin.created = "2026-01-02T03:04:05Z";
  made->origin.leds.assign(24, 255);
  made->model = std::move(model);
  return made;
}

}  // namespace dtact::fakes
