#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "hal/light_ring.hpp"

namespace dtact::net {

/// The paper's five LED configurations by name: "all", and "scheme1" … "scheme4", each four of the
/// eight. The paper shows the four only as pictures, so which LEDs they are is our assignment, by
/// what it says of them: the first three almost equally even, the fourth very uneven and brightest
/// in the upper right corner. LED numbers are those of hal::Light.
///   scheme1  0 2 4 6  every other one
///   scheme2  1 3 5 7  the others
///   scheme3  0 1 4 5  two neighbours and the two opposite
///   scheme4  6 7 0 1  four neighbours, top to right
/// Lit LEDs are white, the others off. Nothing for an unknown name.
[[nodiscard]] std::optional<std::array<hal::Rgb, hal::kLedCount>> scheme_leds(
    std::string_view name);

/// Every name, for messages: "all, scheme1, …".
[[nodiscard]] std::string scheme_names();

}  // namespace dtact::net
