#pragma once

#include <string>
#include <utility>

#include "proto/dtact.pb.h"

namespace dtact::ctl {

/// "brightness 128, LEDs ffffff ffffff …", colours as RRGGBB from LED 0 on.
[[nodiscard]] std::string text_of(const v1::LightState& light);
/// "3:ff8000" → LED 3 with that colour. Throws std::invalid_argument saying what is allowed.
[[nodiscard]] std::pair<int, v1::Rgb> parse_led(const std::string& text);

}  // namespace dtact::ctl
