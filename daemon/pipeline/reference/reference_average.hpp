#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hal/frame.hpp"

namespace dtact::pipeline {

/// The mean of many frames with its fraction kept: averaging wins the sub-grey precision that the
/// depth lives on. All memory is taken at construction.
class ReferenceAverage {
 public:
  /// Throws std::invalid_argument when frames is not 1 … 256 (more would overflow 16-bit sums).
  ReferenceAverage(int width, int height, int frames);

  void reset() noexcept;
  /// Adds a frame of the size given at construction; true once enough have been added.
  [[nodiscard]] bool add(const hal::LumaView& luma) noexcept;
  [[nodiscard]] int added() const noexcept { return added_; }
  /// The mean so far, Q8 luma (0 … 65280), rounded to nearest, row-major without padding. Undefined
  /// before the first frame.
  void write(std::span<std::uint16_t> out_q8) const noexcept;

 private:
  int width_;
  int height_;
  int frames_;
  int added_ = 0;
  std::vector<std::uint16_t> sums_;
};

}  // namespace dtact::pipeline
