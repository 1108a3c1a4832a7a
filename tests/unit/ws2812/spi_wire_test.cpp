#include "hal/ws2812/spi_wire.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cerrno>
#include <stdexcept>

#include "tests/unit/ws2812/chain_model.hpp"
#include "tests/unit/ws2812/fakes.hpp"

namespace dtact::hal::ws2812 {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;

struct Bench {
  test::FakeClock clock;
  std::unique_ptr<test::FakePort> owned = std::make_unique<test::FakePort>(clock);
  test::FakePort& port = *owned;
  SpiWire wire(const SpiFormat& format = {}, bool check_rate = true) {
    return SpiWire(std::move(owned), format, check_rate, clock);
  }
};

TEST(Ws2812SpiWire, MeasuresTheRateWhateverACallCosts) {
  Bench bench;
  for (const double hz : {1e6, 2.5e6, 3.2e6, 10e6}) {
    bench.port.hz = hz;
    for (const std::int64_t overhead : {0, 80'000, 3'000'000}) {
      bench.port.overhead_ns = overhead;
      EXPECT_NEAR(measure_rate(bench.port, bench.clock).hz, hz, hz * 1e-4);
    }
  }
}

TEST(Ws2812SpiWire, MeasuresWithZerosWithinBufsiz) {
  Bench bench;
  bench.port.bufsiz = 1000;
  (void)measure_rate(bench.port, bench.clock);
  EXPECT_EQ(bench.port.longest, 1000U);
  EXPECT_EQ(bench.port.sent, std::vector<std::uint8_t>(1000, 0));
}

TEST(Ws2812SpiWire, ATrueRateIsAccepted) {
  Bench bench;
  SpiWire wire = bench.wire();
  EXPECT_EQ(wire.prepare(8), "");
  EXPECT_EQ(wire.note(), "");
}

TEST(Ws2812SpiWire, ASlowedCoreClockIsRefusedByName) {
  Bench bench;
  bench.port.hz = 3.2e6 * 200 / 500;  // the core clock at 200 MHz, the divider made for 500
  SpiWire wire = bench.wire();
  const std::string refused = wire.prepare(8);
  EXPECT_THAT(refused, HasSubstr("asked for 3.200 MHz, the controller really sends 1.280 MHz"));
  EXPECT_THAT(refused, HasSubstr("core_freq=500"));
}

TEST(Ws2812SpiWire, ASmallDeviationIsANote) {
  Bench bench;
  bench.port.hz = 3.05e6;
  SpiWire wire = bench.wire();
  EXPECT_EQ(wire.prepare(8), "");
  EXPECT_THAT(wire.note(), HasSubstr("measured 3.050 MHz (-4.7 %)"));
  EXPECT_THAT(wire.note(), HasSubstr("core_freq"));
}

TEST(Ws2812SpiWire, AControllerThatTakesNoTimeIsRefused) {
  Bench bench;
  bench.port.hz = 0;
  SpiWire wire = bench.wire();
  EXPECT_THAT(wire.prepare(8), HasSubstr("take no time"));
}

TEST(Ws2812SpiWire, TheCheckCanBeTurnedOff) {
  Bench bench;
  bench.port.hz = 1e6;
  SpiWire wire = bench.wire({}, false);
  EXPECT_EQ(wire.prepare(8), "");
  EXPECT_TRUE(bench.port.sent.empty());
}

TEST(Ws2812SpiWire, NamesTheBufsizThatIsNeeded) {
  Bench bench;
  bench.port.bufsiz = 335;
  SpiWire wire = bench.wire();
  EXPECT_THAT(wire.prepare(8), HasSubstr("8 LEDs need 336 bytes"));
  EXPECT_THAT(wire.prepare(8), HasSubstr("spidev.bufsiz=4096"));
}

TEST(Ws2812SpiWire, SendsWhatAChainThenShows) {
  Bench bench;
  SpiWire wire = bench.wire();
  const std::array<Rgb, 3> leds{Rgb{1, 2, 3}, Rgb{255, 0, 128}, Rgb{0, 0, 0}};
  EXPECT_EQ(wire.send(leds), "");
  test::ChainModel chain;
  chain.spi(bench.port.sent, 3.2e6);
  EXPECT_THAT(chain.shown(), ElementsAreArray(leds));
  EXPECT_EQ(chain.odd_pulses(), 0);
}

TEST(Ws2812SpiWire, ErrorsNameDeviceAndRemedy) {
  Bench bench;
  SpiWire wire = bench.wire();
  bench.port.error = EACCES;
  EXPECT_THAT(wire.send({}), HasSubstr("/dev/fakespi: write failed: Permission denied: put the "
                                       "user into the group"));
  EXPECT_THAT(wire.prepare(8), HasSubstr("Permission denied"));
  bench.port.error = EMSGSIZE;
  EXPECT_THAT(wire.send({}), HasSubstr("spidev.bufsiz"));
}

// What spidev's ioctl answers once its device is unbound: ESHUTDOWN (spidev_sync in
// drivers/spi/spidev.c). An error on the bus is none of that.
TEST(Ws2812SpiWire, IsLostWithItsDeviceOnly) {
  Bench bench;
  SpiWire wire = bench.wire();
  EXPECT_FALSE(wire.lost());
  bench.port.error = EIO;
  EXPECT_NE(wire.send({}), "");
  EXPECT_FALSE(wire.lost());
  for (const int gone : {ESHUTDOWN, ENODEV, ENXIO}) {
    bench.port.error = gone;
    EXPECT_THAT(wire.send({}), HasSubstr("turn the SPI controller on"));
    EXPECT_TRUE(wire.lost());
  }
}

TEST(Spidev, AnAbsentDeviceIsNamedWithTheRemedy) {
  try {
    const Spidev port("/dev/spidev-that-is-not-there", 3'200'000);
    FAIL() << "opened";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("/dev/spidev-that-is-not-there: cannot be opened"));
    EXPECT_THAT(e.what(), HasSubstr("dtparam=spi=on"));
  }
}

TEST(Spidev, AFileThatIsNoSpiDeviceIsRefused) {
  EXPECT_THROW((void)Spidev("/dev/null", 3'200'000), std::runtime_error);
}

}  // namespace
}  // namespace dtact::hal::ws2812
