#include "daemon/net/light_schemes.hpp"

#include <gtest/gtest.h>

namespace dtact::net {
namespace {

/// "1" for each white LED, "0" for each that is off, LED 0 first.
std::string lit(std::string_view name) {
  std::string text;
  const auto leds = scheme_leds(name);
  if (!leds.has_value()) return "unknown";
  for (const auto& led : *leds) {
    text += led == hal::Rgb{255, 255, 255} ? '1' : led == hal::Rgb{} ? '0' : '?';
  }
  return text;
}

TEST(LightSchemes, AreAllOrFourOfTheEight) {
  EXPECT_EQ(lit("all"), "11111111");
  EXPECT_EQ(lit("scheme1"), "11001100");
  EXPECT_EQ(lit("scheme2"), "00110011");
  EXPECT_EQ(lit("scheme3"), "01100110");
  EXPECT_EQ(lit("scheme4"), "11000011");
}

TEST(LightSchemes, OthersAreUnknown) {
  EXPECT_EQ(lit("scheme5"), "unknown");
  EXPECT_EQ(lit(""), "unknown");
  EXPECT_EQ(lit("ALL"), "unknown");
}

TEST(LightSchemes, HaveNames) {
  EXPECT_EQ(scheme_names(), "all, scheme1, scheme2, scheme3, scheme4");
}

}  // namespace
}  // namespace dtact::net
