#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

#include "clients/calibrate/fit/model/gel_model.hpp"
#include "clients/calibrate/fit/model/radial_transform.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// A camera's view of a ball pressed into a gel, predicted by the gel's model.
struct ImaginedView {
  static constexpr double kMmPerPx = 0.06;

  int width = 400;
  int height = 360;
  double col = 200;  ///< The ball's middle.
  double row = 180;
  GelModel gel = {.thickness_mm = 2.2,
                  .response = {.slopes = {1.6, 1.1, 0.42, 0.4, 0.36}, .bulge_factor = 1},
                  .scattering = {0.28, 1.3, 0.72}};
  double ball_radius_mm = 4;
  double contact_radius_mm = 2.8;
  /// Grey level of the undeformed surface at a pixel.
  std::function<double(int x, int y)> light = [](int, int) { return 160.0; };
  /// Factor of darkening at a pixel.
  std::function<double(int x, int y)> gain = [](int, int) { return 1.0; };

  [[nodiscard]] BallContact contact() const {
    return press_ball(ball_radius_mm, contact_radius_mm, gel.thickness_mm);
  }
  [[nodiscard]] image::Grey16 reference_image_q8() const {
    image::Grey16 image{width, height, {}};
    each([&](int x, int y) {
      image.pixels.push_back(static_cast<std::uint16_t>(std::lround(256 * light(x, y))));
    });
    return image;
  }
  [[nodiscard]] image::Grey8 frame() const {
    const RadialTransform& radial = RadialTransform::instance();
    const Eigen::VectorXd loss = radial.values(
        predict_press(gel, contact()).spectrum.cwiseProduct(scattered(gel.scattering)));
    image::Grey8 image{width, height, {}};
    each([&](int x, int y) {
      const double place = std::hypot(x - col, y - row) * kMmPerPx / RadialTransform::kStepMm;
      const auto at = std::min<Eigen::Index>(static_cast<Eigen::Index>(place), loss.size() - 2);
      const double part = std::min(1.0, place - static_cast<double>(at));
      const double lost = std::lerp(loss[at], loss[at + 1], part);
      // Dithered before rounding, so that means over pixels hold fractions of a level.
      const double dither = ((x + 2 * y) % 4 - 1.5) / 4;
      const double level = light(x, y) * (1 - lost / gain(x, y));
      image.pixels.push_back(static_cast<std::uint8_t>(std::lround(level + dither)));
    });
    return image;
  }

 private:
  template <typename Visit>
  void each(const Visit& visit) const {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) visit(x, y);
    }
  }
};

}  // namespace dtact::calibration
