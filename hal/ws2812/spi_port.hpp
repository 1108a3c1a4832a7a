#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "hal/base/unique_fd.hpp"

namespace dtact::hal::ws2812 {

/// Where the encoded bytes go.
class SpiPort {
 public:
  SpiPort() = default;
  SpiPort(const SpiPort&) = delete;
  SpiPort& operator=(const SpiPort&) = delete;
  virtual ~SpiPort() = default;

  [[nodiscard]] virtual std::string name() const = 0;
  /// The longest transfer, bytes.
  [[nodiscard]] virtual std::size_t max_bytes() const = 0;
  /// Sends the bytes without a pause and waits until they are through. Returns 0 or an errno.
  [[nodiscard]] virtual int transfer(std::span<const std::uint8_t> bytes) noexcept = 0;
};

/// /dev/spidevB.C in mode 0, 8 bits a word.
class Spidev final : public SpiPort {
 public:
  /// Throws std::runtime_error naming the device and the remedy (absent, no permission, refuses
  /// mode or speed).
  Spidev(const std::string& device, std::uint32_t hz);

  [[nodiscard]] std::string name() const override { return device_; }
  [[nodiscard]] std::size_t max_bytes() const override { return max_bytes_; }
  [[nodiscard]] int transfer(std::span<const std::uint8_t> bytes) noexcept override;

 private:
  std::string device_;
  std::uint32_t hz_;
  std::size_t max_bytes_;
  base::UniqueFd fd_;
};

/// What an errno of a spidev call means for its user: the remedy as a sentence's end.
[[nodiscard]] std::string spi_remedy(int error);

}  // namespace dtact::hal::ws2812
