#include "clients/ctl/light_text.hpp"

#include <fmt/format.h>

#include <charconv>
#include <stdexcept>

#include "clients/ctl/json/json.hpp"

namespace dtact::ctl {
namespace {

std::string hex(const client::Rgb& led) {
  return fmt::format("{:02x}{:02x}{:02x}", led.r, led.g, led.b);
}

}  // namespace

std::string text_of(const client::Light& light) {
  std::string text = fmt::format("brightness {}, LEDs", light.brightness);
  for (const auto& led : light.leds) text += " " + hex(led);
  return text;
}

void add_light(const client::Light& light, Json& json) {
  json.open('{').member("brightness", light.brightness).key("leds").open('[');
  for (const auto& led : light.leds) json.value(std::string_view(hex(led)));
  json.close(']').close('}');
}

std::pair<std::size_t, client::Rgb> parse_led(const std::string& text) {
  const auto wrong = [&text] {
    return std::invalid_argument("--led " + text +
                                 ": write NUMBER:RRGGBB, the number 0 to 7 and the colour in "
                                 "hexadecimal, as in 3:ff8000");
  };
  if (text.size() != 8 || text[0] < '0' || text[0] > '7' || text[1] != ':') throw wrong();
  std::uint32_t colour = 0;
  const auto [end, error] = std::from_chars(text.data() + 2, text.data() + 8, colour, 16);
  if (error != std::errc{} || end != text.data() + 8) throw wrong();
  return {static_cast<std::size_t>(text[0] - '0'),
          {static_cast<std::uint8_t>(colour >> 16U), static_cast<std::uint8_t>(colour >> 8U),
           static_cast<std::uint8_t>(colour)}};
}

}  // namespace dtact::ctl
