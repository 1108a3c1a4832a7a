#pragma once

#include <string>
#include <utility>

#include "clients/cpp/types.hpp"

namespace dtact::ctl {

class Json;

/// "brightness 128, LEDs ffffff ffffff …", colours as RRGGBB from LED 0 on.
[[nodiscard]] std::string text_of(const client::Light& light);
/// {"brightness":128,"leds":["ffffff",…]}
void add_light(const client::Light& light, Json& json);
/// "3:ff8000" → LED 3 with that colour. Throws std::invalid_argument saying what is allowed.
[[nodiscard]] std::pair<std::size_t, client::Rgb> parse_led(const std::string& text);

}  // namespace dtact::ctl
