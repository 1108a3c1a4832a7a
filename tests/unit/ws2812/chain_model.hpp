#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hal/light_ring.hpp"

namespace dtact::hal::ws2812::test {

/// A chain of WS2812B after the datasheet, written independently of the encoder: it reads
/// levels and durations, measures high pulses, shifts bits, and shows them after a long low. Times
/// are nanoseconds.
class ChainModel {
 public:
  void level(bool high, double ns) {
    if (high != high_) {
      if (high_) end_of_high();
      high_ = high;
      lasted_ = 0;
    }
    lasted_ += ns;
    if (!high_ && lasted_ > 280'000) latch();
  }

  /// SPI bytes as they appear on the data line, most significant bit first.
  void spi(std::span<const std::uint8_t> bytes, double hz) {
    for (const std::uint8_t byte : bytes) {
      for (int bit = 7; bit >= 0; --bit) level((byte >> bit & 1) != 0, 1e9 / hz);
    }
  }

  /// Colours shown since the last latch that brought any; one for each LED that was reached.
  [[nodiscard]] const std::vector<Rgb>& shown() const { return shown_; }
  /// High pulses that are neither a 0 (200 … 400) nor a 1 (600 … 1000).
  [[nodiscard]] int odd_pulses() const { return odd_; }
  [[nodiscard]] int latches() const { return latches_; }

 private:
  void end_of_high() {
    const bool zero = lasted_ > 199.9 && lasted_ < 400.1;
    const bool one = lasted_ > 599.9 && lasted_ < 1000.1;
    if (!zero && !one) ++odd_;
    bits_.push_back(lasted_ > 500);
  }

  void latch() {
    if (bits_.size() >= 24) {
      ++latches_;
      shown_.clear();
      for (std::size_t i = 0; i + 24 <= bits_.size(); i += 24) {
        const auto channel = [&](std::size_t at) {
          unsigned value = 0;
          for (std::size_t k = 0; k < 8; ++k) value = value * 2 + (bits_[i + at + k] ? 1 : 0);
          return static_cast<std::uint8_t>(value);
        };
        shown_.push_back({channel(8), channel(0), channel(16)});  // sent as G, R, B
      }
    }
    bits_.clear();
  }

  bool high_ = false;
  double lasted_ = 0;
  std::vector<bool> bits_;
  std::vector<Rgb> shown_;
  int odd_ = 0;
  int latches_ = 0;
};

}  // namespace dtact::hal::ws2812::test
