#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "hal/light_ring.hpp"

namespace dtact::net {

/// The paper's five LED configurations by name: "all", and "scheme1" … "scheme4", each four of the
/// eight. The paper shows the four only as pictures, so which LEDs they are is our assignment by
/// its description: the first three are equally uneven (a standard deviation of 5.2 to 5.5
/// grey levels against 4.1 with all), the fourth very uneven (16.6) and brightest in the upper
/// right corner. Every other LED would be as even as all eight; two neighbours and the two opposite
/// ones lie between. LED numbers are those of hal::Light.
///   scheme1  0 1 4 5  two neighbours and the two opposite
///   scheme2  2 3 6 7  the others
///   scheme3  1 2 5 6  scheme 1, one LED on
///   scheme4  6 7 0 1  four neighbours, top to right
/// Lit LEDs are white, the others off. Returns nothing for an unknown name.
[[nodiscard]] std::optional<std::array<hal::Rgb, hal::kLedCount>> scheme_leds(
    std::string_view name);

/// Every name, for messages: "all, scheme1, …".
[[nodiscard]] std::string scheme_names();

}  // namespace dtact::net
