#include "hal/gpiod/power_switch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <vector>

namespace dtact::hal::gpiod {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class FakeClock final : public base::Clock {
 public:
  [[nodiscard]] std::int64_t monotonic_ns() const noexcept override { return now; }
  [[nodiscard]] std::int64_t wall_ns() const noexcept override { return now; }
  void sleep_until(std::int64_t deadline_ns) noexcept override { now = std::max(now, deadline_ns); }
  std::int64_t now = 1000;
};

class FakeLine final : public OutputLine {
 public:
  FakeLine(std::vector<bool>& levels, int error) : levels_(levels), error_(error) {}
  [[nodiscard]] int set(bool active) noexcept override {
    levels_.push_back(active);
    return error_;
  }

 private:
  std::vector<bool>& levels_;
  int error_;
};

TEST(PowerSwitch, OnFromConstructionToDestruction) {
  FakeClock clock;
  std::vector<bool> levels;
  {
    const PowerSwitch power(std::make_unique<FakeLine>(levels, 0), 50, clock);
    EXPECT_THAT(levels, ElementsAre(true));
    EXPECT_EQ(clock.now, 1000 + 50'000'000) << "the supply settles first";
  }
  EXPECT_THAT(levels, ElementsAre(true, false));
}

TEST(PowerSwitch, CanBeLeftOn) {
  FakeClock clock;
  std::vector<bool> levels;
  {
    PowerSwitch power(std::make_unique<FakeLine>(levels, 0), 0, clock);
    power.leave_on();
  }
  EXPECT_THAT(levels, ElementsAre(true));
}

TEST(PowerSwitch, ALineThatCannotBeDrivenStopsTheStart) {
  FakeClock clock;
  std::vector<bool> levels;
  EXPECT_THROW(PowerSwitch(std::make_unique<FakeLine>(levels, EIO), 50, clock), std::runtime_error);
}

TEST(GpioLines, AnAbsentChipIsNamedWithKeyAndFix) {
  try {
    (void)open_output({"no-such-chip", 3, false}, false, "ring.ws2812.power");
    FAIL() << "opened";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("ring.ws2812.power: chip \"no-such-chip\" line 3"));
    EXPECT_THAT(e.what(), HasSubstr("chips here:"));
  }
}

TEST(GpioLines, WhatIsNoChipCannotBeRead) {
  EXPECT_NE(read_chip("/dev/null").error, 0);
  EXPECT_NE(read_chip("/dev/gpiochip-that-is-not-there").error, 0);
}

TEST(GpioLines, TheLibraryHasAVersion) { EXPECT_FALSE(library_version().empty()); }

}  // namespace
}  // namespace dtact::hal::gpiod
