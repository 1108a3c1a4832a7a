#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// A ball of 4 mm pressed in by `depth_mm`, on a surface that darkens by 30 levels a millimetre and
/// brightens by 20 in a ring between 4 and 6 mm. 0.05 mm a pixel.
struct Ball {
  double col = 120.25;
  double row = 110.5;
  double depth_mm = 1.5;
  int width = 260;
  int height = 240;

  [[nodiscard]] double level(int x, int y) const {
    const double r = 0.05 * std::hypot(x - col, y - row);
    if (r > 4 && r < 6) return -20;
    const double sag = 4 - std::sqrt(std::max(0.0, 16 - r * r));
    return std::max(0.0, 30 * (depth_mm - sag));
  }
  [[nodiscard]] DarkeningMap map() const {
    DarkeningMap map{width, height, 0.05, {}};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) map.levels.push_back(static_cast<float>(level(x, y)));
    }
    return map;
  }
  /// The same as a frame over a contact-free grey of 200.
  [[nodiscard]] image::Grey8 frame() const {
    image::Grey8 image{width, height, {}};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        image.pixels.push_back(static_cast<std::uint8_t>(std::lround(200 - level(x, y))));
      }
    }
    return image;
  }
  [[nodiscard]] image::Grey8 reference_image() const {
    image::Grey8 image{width, height, {}};
    image.pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 200);
    return image;
  }
  [[nodiscard]] image::Grey16 reference_image_q8() const {
    image::Grey16 image{width, height, {}};
    image.pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                        200 * 256);
    return image;
  }
};

/// A part of the picture that shows the housing: 28 grey levels, and 20 while the ball is in. This
/// is 57 of 200 as a share of the light, more than the ball's 45.
inline void darken(image::Grey16& reference_q8, image::Grey8& frame, int from_x, int from_y,
                   int side) {
  for (int y = from_y; y < from_y + side; ++y) {
    for (int x = from_x; x < from_x + side; ++x) {
      const auto at = static_cast<std::size_t>(y * frame.width + x);
      reference_q8.pixels[at] = 28 * 256;
      frame.pixels[at] = 20;
    }
  }
}

}  // namespace dtact::calibration
