#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/upsample_kernels.hpp"

namespace dtact::recon {

/// Reads a coarse depth map bilinearly at the pixels of a finer one of the same calibration
/// (decimate(): both leave out what fills no pixel on both sides alike). A pixel is as trusted as
/// the coarse one that it lies in; untrusted neighbours are not read. Allocates in the constructor
/// only.
class Upsampler {
 public:
  /// Upsamples a calibration's map of `width` × `height` pixels from 1/`from` to 1/`to` of its
  /// resolution: 1, 2 or 4, `to` below `from`.
  Upsampler(int width, int height, int from, int to);

  /// The finer map.
  [[nodiscard]] int width() const noexcept { return columns_.fine; }
  [[nodiscard]] int height() const noexcept { return rows_.fine; }
  [[nodiscard]] int decimation() const noexcept { return to_; }

  /// Both row-major without padding, within ±16383 micrometres or kUntrusted. Rounded half up,
  /// along rows first.
  void run(std::span<const std::int16_t> coarse_um, std::span<std::int16_t> fine_um) noexcept;

 private:
  /// One axis of the two maps.
  struct Axis {
    int coarse = 0;  ///< Pixels.
    int fine = 0;
    int begin = 0;  ///< Fine pixels before the first coarse one.
    kernels::Phases phases;
  };
  [[nodiscard]] static Axis axis(int size, int from, int to);
  void widen(const std::int16_t* coarse, std::int16_t* wide) noexcept;

  int to_;
  Axis columns_;
  Axis rows_;
  std::size_t stride_;
  std::vector<std::int16_t> line_;  ///< A coarse row with its edges replicated.
  std::vector<std::int16_t> wide_;  ///< Coarse rows, already as wide as the finer map.
};

}  // namespace dtact::recon
