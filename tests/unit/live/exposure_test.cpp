#include "hal/live/exposure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace dtact::hal::live {
namespace {

TEST(Exposure, ComesInMicrosecondsOrPeriods) {
  EXPECT_EQ(exposure_us("s", 0, 0, 0), 0);
  EXPECT_EQ(exposure_us("s", 5000, 0, 2000), 5000);
  EXPECT_EQ(exposure_us("s", 0.5, 0, 2000), 0.5);
  EXPECT_EQ(exposure_us("s", 0, 8, 2000), 4000);  // 8 × 500 µs
  EXPECT_EQ(exposure_us("s", 0, 1, 0.5), 2e6);
}

TEST(Exposure, RefusesWhatContradicts) {
  EXPECT_THROW((void)exposure_us("s", -1, 0, 0), std::runtime_error);
  EXPECT_THROW((void)exposure_us("s", 0, -1, 2000), std::runtime_error);
  EXPECT_THROW((void)exposure_us("s", 0, 3, 0), std::runtime_error);
  EXPECT_THROW((void)exposure_us("s", 100, 3, 2000), std::runtime_error);
  EXPECT_THROW((void)exposure_us("s", 0.5, 3, 2000), std::runtime_error);
  EXPECT_THROW((void)exposure_us("s", 0, 1, -2000), std::runtime_error);
  EXPECT_THROW((void)exposure_us("s", std::nan(""), 0, 0), std::runtime_error);
}

TEST(Exposure, ReportsRoundingBeyondAHundredth) {
  EXPECT_EQ(rounding_note(1000, 1009), "");
  EXPECT_EQ(rounding_note(1000, 991), "");
  EXPECT_EQ(rounding_note(1000, 1011), "1011 us is the nearest this camera has to 1000.0 us");
  EXPECT_EQ(rounding_note(1000, 989), "989 us is the nearest this camera has to 1000.0 us");
  EXPECT_EQ(rounding_note(1000, 1100), "1100 us is the nearest this camera has to 1000.0 us");
}

}  // namespace
}  // namespace dtact::hal::live
