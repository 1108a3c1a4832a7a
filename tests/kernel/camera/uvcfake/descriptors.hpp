#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace uvcfake {

struct Size {
  std::uint16_t width;
  std::uint16_t height;
};
inline constexpr std::array<Size, 3> kSizes{{{800, 600}, {640, 480}, {1280, 720}}};
/// 60, 30 and 15 frames a second, in 100 ns.
inline constexpr std::array<std::uint32_t, 3> kIntervals{166666, 333333, 666666};

// Format indices of the streaming interface.
inline constexpr std::uint8_t kMjpeg = 1;
inline constexpr std::uint8_t kYuyv = 2;
// Entities of the control interface.
inline constexpr std::uint8_t kCameraTerminal = 1;
inline constexpr std::uint8_t kProcessingUnit = 2;

/// The descriptors of a USB camera: a control interface with a camera terminal, a processing unit
/// and an output terminal, and a streaming interface with MJPEG and YUYV at kSizes and kIntervals.
[[nodiscard]] std::vector<std::uint8_t> device_descriptor();
[[nodiscard]] std::vector<std::uint8_t> configuration_descriptor(bool isochronous);
/// A USB string descriptor: 0 is the language table, 1 maker, 2 product, 3 `serial`. Empty for
/// others.
[[nodiscard]] std::vector<std::uint8_t> string_descriptor(int index, const std::string& serial);

}  // namespace uvcfake
