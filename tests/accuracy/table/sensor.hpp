#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "hal/files/png.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "hal/sim/payload.hpp"
#include "hal/sim/renderer.hpp"
#include "tests/accuracy/table/configuration.hpp"

namespace dtact::table {

/// The simulated sensor under one light, seen through its camera, MJPEG included.
class Sensor {
 public:
  Sensor(const std::shared_ptr<const hal::sim::Truth>& truth, const Configuration& configuration,
         std::uint64_t seed);

  /// Frame `sequence`, decoded like in the daemon.
  [[nodiscard]] image::Grey8 frame(std::uint64_t sequence);
  /// `count` frames of press `index`, at most kStillFrames.
  [[nodiscard]] std::vector<image::Grey8> press(std::size_t index, std::size_t count);
  /// The mean of `count` frames without contact, Q8, at most kStillFrames.
  [[nodiscard]] image::Grey16 reference(std::size_t count);

  [[nodiscard]] const hal::sim::Truth& truth() const noexcept { return renderer_.truth(); }

 private:
  hal::sim::Renderer renderer_;
  hal::sim::LedLevels light_;
  hal::luma::LumaBuffer luma_;
  hal::sim::PayloadEncoder encoder_;
  hal::mjpeg::GreyDecoder decoder_;
  std::vector<std::uint8_t> payload_;
};

/// Mean of several images, rounded to Q8.
[[nodiscard]] image::Grey16 mean_q8(const std::vector<image::Grey8>& frames);
/// An image's crop at 8 bits, rounded.
[[nodiscard]] image::Grey8 crop8(const image::Grey16& q8);

}  // namespace dtact::table
