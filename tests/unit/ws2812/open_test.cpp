#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "hal/ws2812/ring.hpp"

namespace dtact::hal::ws2812 {
namespace {

using testing::HasSubstr;

TEST(OpenSpiRing, AnAbsentDeviceIsLookedForAndNamedWithItsFix) {
  Ws2812Config config;
  config.spi_device = "/dev/spidev-that-is-not-there";
  const auto ring = open_spi_ring(config);
  EXPECT_EQ(ring->info().backend, "ws2812_spi");
  EXPECT_EQ(ring->info().identity, "/dev/spidev-that-is-not-there");
  EXPECT_TRUE(ring->attend({}).away);
  EXPECT_THAT(ring->attend({}).message,
              HasSubstr("/dev/spidev-that-is-not-there: cannot be opened: No such file"));
  EXPECT_THAT(ring->attend({}).message, HasSubstr("dtparam=spi=on"));
}

TEST(OpenSpiRing, ARateWhosePulsesLeaveTheWindowStopsTheStart) {
  Ws2812Config config;
  config.spi_bits = 3;
  config.spi_hz = 2'400'000;
  try {
    (void)open_spi_ring(config);
    FAIL() << "2.4 MHz accepted";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("ring.ws2812.spi_hz: at 2.400 MHz"));
  }
}

}  // namespace
}  // namespace dtact::hal::ws2812
