#include "tests/accuracy/sim/pin_profile.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>

#include "hal/sim/objects.hpp"
#include "hal/sim/renderer.hpp"

namespace dtact::accuracy {
namespace {

constexpr double kPitch_mm = 2.5;  // shared/data/README.md
constexpr std::size_t kRings = 13;

using Pins = std::array<std::array<Centre, 3>, 3>;  // rows of columns

double at(const cv::Mat1d& change, double x, double y) {
  return change(static_cast<int>(std::lround(y)), static_cast<int>(std::lround(x)));
}

PinProfile profile_of(const cv::Mat1d& change, const Pins& pins, double mm_per_px) {
  PinProfile profile;
  std::vector<double> sums(kRings);
  std::vector<double> counts(kRings);
  const int reach = static_cast<int>(std::ceil(kRings * PinProfile::kStep_mm / mm_per_px));
  for (const auto& row : pins) {
    for (const Centre& pin : row) {
      for (int y = static_cast<int>(pin.y) - reach; y <= static_cast<int>(pin.y) + reach; ++y) {
        for (int x = static_cast<int>(pin.x) - reach; x <= static_cast<int>(pin.x) + reach; ++x) {
          const double r = std::hypot(x - pin.x, y - pin.y) * mm_per_px;
          const auto ring = static_cast<std::size_t>(r / PinProfile::kStep_mm);
          if (ring >= kRings) continue;
          sums[ring] += change(y, x);
          counts[ring] += 1;
        }
      }
    }
  }
  for (std::size_t i = 0; i < kRings; ++i) profile.change.push_back(sums[i] / counts[i]);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 2; ++j) {
      const auto half_way = [&](const Centre& a, const Centre& b) {
        return at(change, (a.x + b.x) / 2, (a.y + b.y) / 2);
      };
      profile.between += half_way(pins[i][j], pins[i][j + 1]) / 12;
      profile.between += half_way(pins[j][i], pins[j + 1][i]) / 12;
      if (i < 2) profile.diagonal += half_way(pins[i][j], pins[i + 1][j + 1]) / 4;
    }
  }
  return profile;
}

/// The centroid of the pixels that are at least half as dark as the darkest near a place.
Centre pin_near(const cv::Mat1d& change, const Centre& guess, double reach_px) {
  const auto reach = static_cast<int>(reach_px);
  const cv::Rect window(static_cast<int>(guess.x) - reach, static_cast<int>(guess.y) - reach,
                        2 * reach + 1, 2 * reach + 1);
  double most = 0;
  cv::minMaxLoc(change(window), nullptr, &most);
  double sum = 0;
  Centre pin;
  for (int y = window.y; y < window.y + window.height; ++y) {
    for (int x = window.x; x < window.x + window.width; ++x) {
      const double weight = std::max(change(y, x) - most / 2, 0.0);
      sum += weight;
      pin.x += weight * x;
      pin.y += weight * y;
    }
  }
  return {pin.x / sum, pin.y / sum};
}

}  // namespace

PinProfile real_pins(const std::filesystem::path& folder, const Centre& middle) {
  constexpr double kPublished_mm_per_px =
      0.052;  // of all three sensors, accurate enough to find pins
  const image::Grey8 reference = image::read_png_grey8(folder / "board_reference.png");
  const image::Grey8 board = image::read_png_grey8(folder / "board.png");
  cv::Mat1d change(reference.height, reference.width);
  std::transform(reference.pixels.begin(), reference.pixels.end(), board.pixels.begin(),
                 change.begin(), [](int before, int now) { return double(before - now); });
  // One frame's noise, far narrower than a pin.
  cv::GaussianBlur(change, change, {}, 1.0);
  const double pitch = kPitch_mm / kPublished_mm_per_px;
  Pins pins;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      pins[i][j] = pin_near(change,
                            {middle.x + pitch * (static_cast<double>(j) - 1),
                             middle.y + pitch * (static_cast<double>(i) - 1)},
                            12);
    }
  }
  double pixels = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    pixels += std::hypot(pins[i][2].x - pins[i][0].x, pins[i][2].y - pins[i][0].y) / 12;
    pixels += std::hypot(pins[2][i].x - pins[0][i].x, pins[2][i].y - pins[0][i].y) / 12;
  }
  return profile_of(change, pins, kPitch_mm / pixels);
}

PinProfile simulated_pins(const hal::sim::Scene& sensor, double depth_mm) {
  hal::sim::Scene scene = sensor;
  scene.camera.width = 640;
  scene.camera.height = 480;
  scene.camera.mm_per_px = 0.05;
  scene.loop_to_s = 0;
  scene.gel.grid_mm = 0.1;
  scene.gel.texture = 0;
  scene.presses = {{hal::sim::pin_board(), {{.time_s = 0, .depth_mm = depth_mm}}}};
  hal::sim::Renderer pressed(scene, 1);
  const auto now = pressed.render_clean(0, hal::sim::led_levels({}));
  scene.presses.clear();
  hal::sim::Renderer undeformed(scene, 1);
  const auto before = undeformed.render_clean(0, hal::sim::led_levels({}));
  cv::Mat1d change(scene.camera.height, scene.camera.width);
  std::transform(before.begin(), before.end(), now.begin(), change.begin(),
                 [](int a, int b) { return (a - b) / 64.0; });
  Pins pins;
  const double pitch = kPitch_mm / scene.camera.mm_per_px;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      pins[i][j] = {319.5 + pitch * (static_cast<double>(j) - 1),
                    239.5 + pitch * (static_cast<double>(i) - 1)};
    }
  }
  return profile_of(change, pins, scene.camera.mm_per_px);
}

double rms_difference(const PinProfile& a, const PinProfile& b, double offset) {
  const auto square = [&](double x, double y) { return (x + offset - y) * (x + offset - y); };
  double sum = square(a.between, b.between) + square(a.diagonal, b.diagonal);
  for (std::size_t i = 0; i < a.change.size(); ++i) sum += square(a.change[i], b.change[i]);
  return std::sqrt(sum / static_cast<double>(a.change.size() + 2));
}

}  // namespace dtact::accuracy
