#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/kernels.hpp"

namespace dtact::recon {

/// Taps of a symmetric Gaussian, Q14 from the centre outwards, three standard deviations long and
/// summing to exactly one (the centre takes the rounding). `sigma_px` 0: no smoothing, one tap.
/// Throws std::invalid_argument when sigma is negative or the kernel longer than kMaxRadius.
[[nodiscard]] std::vector<std::int16_t> gaussian_taps(double sigma_px);

/// Rows of int16 with room for the smoothing's borders on either side and a width in whole blocks.
class RowBuffer {
 public:
  RowBuffer(int rows, int width);
  [[nodiscard]] std::int16_t* row(int y) noexcept { return at(y).data() + kernels::kMaxRadius; }

 private:
  [[nodiscard]] std::span<std::int16_t> at(int y) noexcept;

  std::size_t stride_;
  std::vector<std::int16_t> data_;
};

/// Separable smoothing of an image that streams through row by row: what is kept is only the rows
/// the kernel spans. The image's edge is replicated. Allocates in the constructor only.
class Smoother {
 public:
  /// Rows that may be pushed before the ready ones are taken.
  static constexpr int kStrip = 8;

  Smoother(std::vector<std::int16_t> taps, int width, int height);

  /// Begins an image.
  void start() noexcept { pushed_ = 0; }
  /// The next row from the top, in a RowBuffer: the pixels beside the image are overwritten.
  void push(std::int16_t* row) noexcept;
  /// Rows from the top that can be computed by now: the pushed ones less the radius; all at the
  /// end.
  [[nodiscard]] int ready() const noexcept;
  /// Row `y` < ready(), within kStrip of what the last strip made ready, or after the last push any
  /// row not yet taken. Writes padded(width) values.
  void take(int y, std::int16_t* out) noexcept;

 private:
  std::vector<std::int16_t> taps_;
  int radius_;
  int width_;
  int height_;
  int pushed_ = 0;
  int ring_rows_;
  RowBuffer ring_;  ///< Horizontally smoothed rows; image row y lies in row y mod ring_rows_.
  std::vector<const std::int16_t*> span_;
};

}  // namespace dtact::recon
