#pragma once

#include <span>
#include <string>

#include "hal/light_ring.hpp"

namespace dtact::hal::ws2812 {

/// What carries colours to the LEDs. After construction used by one thread, the ring's own. Errors
/// are sentences with the fix; an empty string is success.
class Wire {
 public:
  Wire() = default;
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;
  virtual ~Wire() = default;

  /// The first call: finds out, without a colour that LEDs would show, whether the wire can serve a
  /// chain of `leds`.
  [[nodiscard]] virtual std::string prepare(int leds) = 0;
  /// Information from prepare() or send() that is not an error; empty when none.
  [[nodiscard]] virtual std::string note() const = 0;
  /// Sends one colour to each LED, the chain's first LED first, and waits until it is through.
  [[nodiscard]] virtual std::string send(std::span<const Rgb> leds) = 0;
  /// After a send() that failed: this wire will not work again, or not before it has been prepared
  /// anew. The ring then closes it and opens another.
  [[nodiscard]] virtual bool lost() const { return false; }
};

}  // namespace dtact::hal::ws2812
