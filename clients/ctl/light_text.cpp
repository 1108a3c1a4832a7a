#include "clients/ctl/light_text.hpp"

#include <fmt/format.h>

#include <charconv>
#include <stdexcept>

namespace dtact::ctl {
namespace {

std::string hex(const v1::Rgb& led) {
  return fmt::format("{:02x}{:02x}{:02x}", led.r(), led.g(), led.b());
}

}  // namespace

std::string text_of(const v1::LightState& light) {
  std::string text = fmt::format("brightness {}, LEDs", light.brightness());
  for (const auto& led : light.leds()) text += " " + hex(led);
  return text;
}

std::pair<int, v1::Rgb> parse_led(const std::string& text) {
  const auto wrong = [&text] {
    return std::invalid_argument("--led " + text +
                                 ": write NUMBER:RRGGBB, the number 0 to 7 and the colour in "
                                 "hexadecimal, as in 3:ff8000");
  };
  if (text.size() != 8 || text[0] < '0' || text[0] > '7' || text[1] != ':') throw wrong();
  std::uint32_t colour = 0;
  const auto [end, error] = std::from_chars(text.data() + 2, text.data() + 8, colour, 16);
  if (error != std::errc{} || end != text.data() + 8) throw wrong();
  v1::Rgb led;
  led.set_r(colour >> 16U);
  led.set_g(colour >> 8U & 255U);
  led.set_b(colour & 255U);
  return {text[0] - '0', led};
}

}  // namespace dtact::ctl
