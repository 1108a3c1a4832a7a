#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/light_ring.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "hal/sim/noise.hpp"
#include "hal/sim/payload.hpp"
#include "hal/sim/renderer.hpp"

namespace dtact::atlas {

/// Disturbances of one frame. Default: a clean frame.
struct Shot {
  std::uint64_t moment = 0;  ///< Frame of the solved choreography.
  hal::Light light;          ///< Light that the ring really emits.
  double exposure = 1;       ///< Factor on the light, clipped at 255.
  double covered = 0;        ///< Share of its light that the left third loses.
  double leak = 0;         ///< Grey levels added at the left edge, falling to a tenth at the right.
  double band = 0;         ///< Amplitude of PWM banding, share of the light.
  double band_rows = 90;   ///< Its period: 400 Hz in a rolling shutter of 600 rows at 60 fps.
  double shift_px = 0;     ///< Shift of the image to the right and down.
  double turn_deg = 0;     ///< Rotation about the centre.
  double blur_px = 0;      ///< Standard deviation.
  double noise = 1;        ///< Factor on the noise.
  int jpeg = 0;            ///< Quality 1 … 95; 0: not compressed.
  int dust = 0;            ///< Specks of 0.4 mm that take 30 % of the light, at fixed places.
  int dead_pixels = 0;     ///< Black, at fixed places.
  double stale_share = 0;  ///< Lower share of the picture that repeats the previous frame.
  bool damaged = false;    ///< The payload is truncated: no frame.
};

/// The place in the picture of a still camera that a moved camera's pixel (x, y) shows.
struct Place {
  double x = 0;
  double y = 0;
};
[[nodiscard]] Place unmoved(const Shot& shot, int x, int y, int width, int height);
[[nodiscard]] inline bool moved(const Shot& shot) {
  return shot.shift_px != 0 || shot.turn_deg != 0;
}

/// Makes frames of a solved scene with disturbances. One thread.
class Spoiler {
 public:
  Spoiler(const std::shared_ptr<const hal::sim::Truth>& truth, std::uint64_t seed);

  /// Frame `sequence`; the buffer is valid until the next call.
  [[nodiscard]] hal::LumaView make(const Shot& shot, std::uint64_t sequence);

  [[nodiscard]] const hal::sim::Truth& truth() const noexcept { return renderer_.truth(); }

 private:
  void light_up(const Shot& shot, std::uint64_t sequence);
  void warp(const Shot& shot);
  void blur(double sigma);
  void expose(const Shot& shot, std::uint64_t sequence);
  void compress(int quality);

  hal::sim::Renderer renderer_;
  std::uint64_t seed_;
  int width_;
  int height_;
  std::vector<float> grey_;  // levels
  std::vector<float> scratch_;
  std::vector<std::uint8_t> frame_;
  std::vector<std::uint8_t> before_;
  hal::luma::LumaBuffer out_;
  hal::mjpeg::GreyDecoder decoder_;
  std::vector<std::uint8_t> payload_;
};

}  // namespace dtact::atlas
