#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

namespace dtact::hal {

inline constexpr int kLedCount = 8;

/// Linear command value of each channel, 0 (off) to 255.
struct Rgb {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
  bool operator==(const Rgb&) const = default;
};

/// The requested light. LED 0 is at the image's right (3 o'clock), the others follow
/// clockwise as the camera sees them. Each LED emits its colour scaled by
/// (brightness / 255)^gamma.
struct Light {
  std::array<Rgb, kLedCount> leds = all({255, 255, 255});
  std::uint8_t brightness = 255;
  double gamma = 1;  ///< The ring's, from its configuration; no command changes it.
  bool operator==(const Light&) const = default;

  /// What each LED emits, in steps of a channel at full brightness.
  [[nodiscard]] std::array<Rgb, kLedCount> emitted() const noexcept {
    const double factor = std::pow(brightness / 255.0, gamma);
    const auto shade = [&](std::uint8_t channel) {
      return static_cast<std::uint8_t>(std::lround(channel * factor));
    };
    std::array<Rgb, kLedCount> out{};
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i] = {shade(leds[i].r), shade(leds[i].g), shade(leds[i].b)};
    }
    return out;
  }

  static constexpr std::array<Rgb, kLedCount> all(Rgb colour) {
    std::array<Rgb, kLedCount> leds{};
    leds.fill(colour);
    return leds;
  }
};

struct RingInfo {
  std::string backend;   ///< "null", "sim", ...
  std::string identity;  ///< "/dev/spidev0.0", ...
};

/// What became of a write to the ring.
struct ShowResult {
  bool ok = true;
  std::string message;  ///< When not ok: what failed and the fix. When a current limit dims: why.
  bool away = false;    ///< When not ok: there is no ring to write to now; attend() looks for it.
};

/// Run-time state of a ring.
struct RingReport {
  bool ok = true;            ///< The ring is there and the last write worked.
  bool away = false;         ///< It is looked for; once it is there, show() it its light again.
  std::string message;       ///< When not ok: what failed and the fix.
  std::string note;          ///< information that is not an error; empty = none
  std::uint64_t writes = 0;  ///< Tried, re-sends included.
  /// The longest time until the next call of attend().
  std::chrono::nanoseconds due = std::chrono::milliseconds(250);
};

/// The LEDs that light the gel. One thread uses a ring, and never the capture thread: show() and
/// attend() may block for milliseconds, and for seconds while a device is opened.
class LightRing {
 public:
  LightRing() = default;
  LightRing(const LightRing&) = delete;
  LightRing& operator=(const LightRing&) = delete;
  virtual ~LightRing() = default;

  [[nodiscard]] virtual RingInfo info() const = 0;
  [[nodiscard]] virtual ShowResult show(const Light& light) = 0;
  /// Does what is due by time, re-sending `light`, the one last shown, or looking for a ring that
  /// is away, and reports.
  [[nodiscard]] virtual RingReport attend(const Light& /*light*/) { return {}; }
};

}  // namespace dtact::hal
