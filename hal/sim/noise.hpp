#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace dtact::hal::sim {

/// The camera's noise and its rounding to 8 bits, in integers only: the same seed gives the same
/// bytes with every compiler. Each pixel's noise is a function of seed, sequence, row and column,
/// so frames can be made in any order.
class Noise {
 public:
  /// `read` and `shot` (the latter at 160 grey levels) in grey levels, 0 … 3.
  Noise(std::uint64_t seed, double read, double shot);

  /// For each pixel of a row, the multiplier that add() needs. `grey_q6`: 0 … 16320.
  void amplitude(std::span<const std::uint16_t> grey_q6,
                 std::span<std::int16_t> out) const noexcept;

  /// Adds the noise to one row and rounds: `luma` gets `grey_q6.size()` bytes.
  void add(std::uint64_t sequence, std::uint32_t row, std::span<const std::uint16_t> grey_q6,
           std::span<const std::int16_t> amplitude, std::uint8_t* luma) const noexcept;

 private:
  std::uint64_t seed_;
  std::array<std::int16_t, 256> by_grey_{};
};

}  // namespace dtact::hal::sim
