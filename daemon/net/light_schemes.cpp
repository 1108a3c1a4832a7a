#include "daemon/net/light_schemes.hpp"

#include <cstdint>

namespace dtact::net {
namespace {

struct Scheme {
  std::string_view name;
  std::uint8_t lit;  ///< Bit i: LED i.
};

constexpr std::array<Scheme, 5> kSchemes = {{{"all", 0b1111'1111},
                                             {"scheme1", 0b0011'0011},
                                             {"scheme2", 0b1100'1100},
                                             {"scheme3", 0b0110'0110},
                                             {"scheme4", 0b1100'0011}}};

}  // namespace

std::optional<std::array<hal::Rgb, hal::kLedCount>> scheme_leds(std::string_view name) {
  for (const auto& scheme : kSchemes) {
    if (scheme.name != name) continue;
    std::array<hal::Rgb, hal::kLedCount> leds{};
    for (unsigned i = 0; i < leds.size(); ++i) {
      if ((scheme.lit >> i & 1U) != 0) leds[i] = {255, 255, 255};
    }
    return leds;
  }
  return std::nullopt;
}

std::string scheme_names() {
  std::string names;
  for (const auto& scheme : kSchemes) {
    if (!names.empty()) names += ", ";
    names += scheme.name;
  }
  return names;
}

}  // namespace dtact::net
