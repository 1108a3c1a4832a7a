#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/vector_kernels.hpp"

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
  /// Values from one row to the next.
  [[nodiscard]] std::ptrdiff_t stride() const noexcept {
    return static_cast<std::ptrdiff_t>(stride_);
  }

 private:
  [[nodiscard]] std::span<std::int16_t> at(int y) noexcept;

  std::size_t stride_;
  std::vector<std::int16_t> data_;
};

/// Separable smoothing of an image that streams through in pairs of rows: what is kept is only what
/// the kernel spans, so that it stays in the cache. The image's edge is replicated. Works on any
/// blocks of 32 columns; allocates in the constructor only.
class Smoother {
 public:
  /// Pairs that may be pushed before the ready ones are taken.
  static constexpr int kStrip = 8;

  Smoother(std::span<const std::int16_t> taps, int width, int height);

  /// Pairs of rows in the image; an odd height's last pair is its last row twice.
  [[nodiscard]] int pairs() const noexcept { return pairs_; }
  /// Pairs above and below that a pair's result depends on.
  [[nodiscard]] int reach() const noexcept { return taps_.radius() / 2; }
  /// Columns to the left and right that a pixel's result depends on, at most.
  [[nodiscard]] int radius() const noexcept { return taps_.radius(); }

  /// Rows 2·pair and 2·pair + 1 for the blocks [first, last), in a RowBuffer: radius() columns on
  /// either side are read, too, and those beside the image overwritten. Pairs come in rising order.
  void push(int pair, std::int16_t* row_a, std::int16_t* row_b, int first, int last) noexcept;
  /// The smoothed rows of a pair, for blocks that were pushed for all pairs within reach(); the
  /// last push was at most kStrip + 2·reach() pushes ago.
  void take(int pair, std::int16_t* row_a, std::int16_t* row_b, int first, int last) noexcept;

 private:
  void replicate_sides(std::int16_t* row, int first, int last) const noexcept;
  [[nodiscard]] std::int16_t* ring(int slot) noexcept;

  vec::TapPairs taps_;
  int width_;
  int height_;
  int pairs_;
  int ring_pairs_;
  std::size_t pair_size_;
  /// Horizontally smoothed pairs; pair p lies in slot p mod ring_pairs_. Two more slots hold the
  /// first and the last row doubled, for what lies above and below the image.
  std::vector<std::int16_t> ring_;
  std::vector<const std::int16_t*> span_;
};

}  // namespace dtact::recon
