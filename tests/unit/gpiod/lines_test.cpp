#include "hal/gpiod/lines.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace dtact::hal::gpiod {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A Raspberry Pi 5's first chips, abridged.
std::vector<Chip> chips() {
  return {{"/dev/gpiochip0", "pinctrl-rp1", 4, {"ID_SDA", "", "GPIO2", "FAN"}, {"/dev/gpiochip4"}},
          {"/dev/gpiochip10", "gpio-brcmstb@1", 3, {"FAN", "-", "-"}, {}}};
}

std::string place_of(const GpioLineConfig& line) {
  const Place place = find_line(chips(), line, "key");
  return place.why.empty() ? place.chip + " " + std::to_string(place.line)
                           : place.why + ": " + place.fix;
}

TEST(GpioLine, AChipGoesByPathNameLabelAndLink) {
  for (const char* chip :
       {"/dev/gpiochip0", "gpiochip0", "pinctrl-rp1", "/dev/gpiochip4", "gpiochip4"}) {
    EXPECT_EQ(place_of({.chip = chip, .line = 3}), "/dev/gpiochip0 3") << chip;
  }
  EXPECT_EQ(place_of({.chip = "gpio-brcmstb@1", .line = 0}), "/dev/gpiochip10 0");
  EXPECT_THAT(place_of({.chip = "gpiochip1", .line = 0}),
              AllOf(HasSubstr("no such chip"), HasSubstr("/dev/gpiochip0 (pinctrl-rp1, 4 lines)")));
}

TEST(GpioLine, AnOffsetIsOneOfTheChips) {
  EXPECT_THAT(place_of({.chip = "gpiochip0", .line = 4}), HasSubstr("it has lines 0 … 3"));
  EXPECT_THAT(place_of({.chip = "gpiochip0"}),
              AllOf(HasSubstr("it has lines 0 … 3"), HasSubstr("set key.line or .name")));
}

TEST(GpioLine, ANameIsFoundOnAnyChip) {
  EXPECT_EQ(place_of({.name = "GPIO2"}), "/dev/gpiochip0 2");
  EXPECT_EQ(place_of({.chip = "gpiochip10", .name = "FAN"}), "/dev/gpiochip10 0");
  EXPECT_THAT(place_of({.name = "GPIO3"}), HasSubstr("no line has this name"));
  EXPECT_THAT(place_of({.chip = "gpiochip10", .name = "GPIO2"}), HasSubstr("no line has"));
}

TEST(GpioLine, ANameThatSeveralBearIsRefused) {
  EXPECT_THAT(place_of({.name = "FAN"}),
              AllOf(HasSubstr("/dev/gpiochip0 line 3 has this name and /dev/gpiochip10 line 0"),
                    HasSubstr("set key.chip and key.line")));
  EXPECT_THAT(place_of({.chip = "gpiochip10", .name = "-"}), HasSubstr("line 1 has this name"));
}

TEST(GpioLine, AHolderMayHaveNoName) {
  EXPECT_EQ(holder_name("lcd-reset"), "\"lcd-reset\"");
  for (const char* none : {"", "?", static_cast<const char*>(nullptr)}) {
    EXPECT_EQ(holder_name(none), "something that gave no name");
  }
}

TEST(GpioLine, MessagesNameWhatIsConfigured) {
  EXPECT_EQ(describe({.chip = "gpiochip0", .line = 17}), "chip \"gpiochip0\" line 17");
  EXPECT_EQ(describe({.name = "GPIO17"}), "line \"GPIO17\"");
  EXPECT_EQ(describe({.chip = "gpiochip0", .name = "GPIO17"}),
            "chip \"gpiochip0\" line \"GPIO17\"");
}

}  // namespace
}  // namespace dtact::hal::gpiod
