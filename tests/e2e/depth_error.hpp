#pragma once

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "clients/cpp/maps.hpp"
#include "hal/sim/truth.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {

/// Error of a streamed depth map against the simulator's truth.
struct DepthError {
  double inside_mm = 0;   ///< Mean absolute error inside the true contact; NaN without contact.
  double outside_mm = 0;  ///< The same everywhere else.
  int inside_pixels = 0;  ///< Pixels of the map that lie in the true contact.
  int untrusted = 0;      ///< Untrusted pixels of the true contact.
};

inline DepthError depth_error(const v1::Frame& frame, const hal::sim::Truth& truth) {
  if (!frame.has_depth()) throw std::invalid_argument("a frame without depth");
  std::vector<float> indentation;
  std::vector<std::uint8_t> contact;
  truth.indentation_mm(frame.sequence(), indentation);
  truth.contact(frame.sequence(), contact);
  const auto width = static_cast<std::size_t>(truth.scene().camera.width);

  // The map shows the middle of the image. Its pixels are means of `step` × `step` of the truth's.
  const auto map_width = static_cast<std::size_t>(frame.depth().width());
  const auto map_height = static_cast<std::size_t>(frame.depth().height());
  const std::size_t step = frame.depth().decimation();
  const std::size_t column = (width - map_width * step) / 2;
  const std::size_t row =
      (static_cast<std::size_t>(truth.scene().camera.height) - map_height * step) / 2;
  const std::vector<float> mm = client::millimetres_of(frame.depth());

  DepthError error;
  double inside = 0;
  double outside = 0;
  int outside_pixels = 0;
  for (std::size_t y = 0; y < map_height; ++y) {
    for (std::size_t x = 0; x < map_width; ++x) {
      double expected = 0;
      bool in_contact = true;
      for (std::size_t i = 0; i < step * step; ++i) {
        const std::size_t at = (y * step + i / step + row) * width + x * step + i % step + column;
        expected += static_cast<double>(indentation[at]) / static_cast<double>(step * step);
        in_contact = in_contact && contact[at] != 0;
      }
      const float depth = mm[y * map_width + x];
      if (in_contact) ++error.inside_pixels;
      if (std::isnan(depth)) {
        if (in_contact) ++error.untrusted;
        continue;
      }
      const double difference = std::abs(static_cast<double>(depth) - expected);
      (in_contact ? inside : outside) += difference;
      if (!in_contact) ++outside_pixels;
    }
  }
  error.inside_mm = inside / (error.inside_pixels - error.untrusted);
  error.outside_mm = outside / outside_pixels;
  return error;
}

}  // namespace dtact::e2e
