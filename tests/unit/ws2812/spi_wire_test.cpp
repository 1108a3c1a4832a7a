#include "hal/ws2812/spi_wire.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cerrno>
#include <random>
#include <stdexcept>

#include "tests/unit/ws2812/chain_model.hpp"
#include "tests/unit/ws2812/fakes.hpp"

namespace dtact::hal::ws2812 {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;

constexpr std::array<Rgb, 8> kDark{};

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

TEST(Ws2812SpiWire, MeasuresWhatACallCosts) {
  Bench bench;
  bench.port.overhead_ns = 130'000;
  EXPECT_NEAR(measure_rate(bench.port, bench.clock).overhead_ns, 130'000, 100);
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
  EXPECT_EQ(wire.send(kDark), "");
  EXPECT_EQ(bench.port.pictures, 1);
}

TEST(Ws2812SpiWire, NamesTheBufsizThatIsNeeded) {
  Bench bench;
  bench.port.bufsiz = 335;
  SpiWire wire = bench.wire();
  EXPECT_THAT(wire.prepare(8), HasSubstr("8 LEDs need 336 bytes"));
  EXPECT_THAT(wire.prepare(8), HasSubstr("spidev.bufsiz=4096"));
}

TEST(Ws2812SpiWire, TheLongestChainThatFitsBufsiz) {
  struct Case {
    SpiFormat format;
    int leds;
  };
  for (const Case& c : {Case{{3, 2.7e6}, 432}, {{4, 3.2e6}, 321}, {{8, 6.4e6}, 150}}) {
    Bench bench;
    SpiWire wire = bench.wire(c.format, false);
    EXPECT_EQ(wire.prepare(c.leds), "");
    EXPECT_THAT(wire.prepare(c.leds + 1), HasSubstr("spidev takes 4096: put spidev.bufsiz=41"));
  }
}

TEST(Ws2812SpiWire, SendsWhatAChainThenShows) {
  Bench bench;
  SpiWire wire = bench.wire();
  ASSERT_EQ(wire.prepare(3), "");
  const std::array<Rgb, 3> leds{Rgb{1, 2, 3}, Rgb{255, 0, 128}, Rgb{0, 0, 0}};
  EXPECT_EQ(wire.send(leds), "");
  test::ChainModel chain;
  chain.spi(bench.port.sent, 3.2e6);
  EXPECT_THAT(chain.shown(), ElementsAreArray(leds));
  EXPECT_EQ(chain.odd_pulses(), 0);
}

TEST(Ws2812SpiWire, ErrorsNameDeviceAndFix) {
  Bench bench;
  SpiWire wire = bench.wire();
  bench.port.error = EACCES;
  EXPECT_THAT(wire.send({}), HasSubstr("/dev/fakespi: write failed: Permission denied: put the "
                                       "user into the group"));
  EXPECT_THAT(wire.prepare(8), HasSubstr("Permission denied"));
  bench.port.error = EPERM;
  EXPECT_THAT(wire.send({}), HasSubstr("DeviceAllow="));
  bench.port.error = EMSGSIZE;
  EXPECT_THAT(wire.send({}), HasSubstr("spidev.bufsiz"));
}

// The clock is off for one transfer, like a Raspberry Pi 4's whose core falls from 500 to 200 MHz.
TEST(Ws2812SpiWire, ATransferThatWasOffIsSentAgain) {
  Bench bench;
  SpiWire wire = bench.wire();
  ASSERT_EQ(wire.prepare(8), "");
  bench.port.odd_hz = {1.28e6};
  EXPECT_EQ(wire.send(kDark), "");
  EXPECT_EQ(bench.port.pictures, 2);
  EXPECT_FALSE(wire.lost());
  // 2688 bits, and the cost of a call: 0.08 ms.
  EXPECT_EQ(wire.note(),
            "/dev/fakespi: 1 of 2 transfers were off and sent again, the last 2.18 ms for 0.92 ms: "
            "the clock, or a busy machine");
  EXPECT_EQ(wire.send(kDark), "");
  EXPECT_EQ(bench.port.pictures, 3);
}

TEST(Ws2812SpiWire, AClockThatChangedIsNamedAfterThreeTransfersInARow) {
  for (const double hz : {1.28e6, 8e6}) {
    Bench bench;
    SpiWire wire = bench.wire();
    ASSERT_EQ(wire.prepare(8), "");
    bench.port.hz = hz;
    const std::string error = wire.send(kDark);
    EXPECT_THAT(error, HasSubstr(hz < 3e6 ? "/dev/fakespi: asked for 3.200 MHz, the controller "
                                            "really sends 1.280 MHz"
                                          : "really sends 8.000 MHz"));
    EXPECT_THAT(error, HasSubstr("core_freq_min=500"));
    EXPECT_THAT(error, HasSubstr("core_freq=250"));
    EXPECT_THAT(error, HasSubstr("force_turbo=1"));
    EXPECT_THAT(error, HasSubstr("spi_bits = 8"));
    EXPECT_EQ(bench.port.pictures, 3) << "and none while the clock is known to be off";
    EXPECT_TRUE(wire.lost());
    bench.port.hz = 3.2e6;
    EXPECT_EQ(wire.prepare(8), "");
    EXPECT_EQ(wire.send(kDark), "");
    EXPECT_FALSE(wire.lost());
  }
}

TEST(Ws2812SpiWire, EachEncodingToleratesItsWindow) {
  struct Case {
    SpiFormat format;
    double slowest, fastest;
  };
  for (const Case& c : {Case{{3, 2.7e6}, 2.50e6, 3.33e6},
                        {{4, 3.2e6}, 3.00e6, 4.54e6},
                        {{8, 6.4e6}, 5e6, 8.33e6}}) {
    for (const double hz :
         {c.slowest * 0.99, c.slowest * 1.01, c.fastest * 0.99, c.fastest * 1.01}) {
      Bench bench;
      bench.port.hz = c.format.hz;
      SpiWire wire = bench.wire(c.format);
      ASSERT_EQ(wire.prepare(8), "");
      bench.port.hz = hz;
      const bool fits = hz > c.slowest && hz < c.fastest;
      EXPECT_EQ(wire.send(kDark).empty(), fits) << c.format.bits << " bits at " << hz;
      EXPECT_EQ(bench.port.pictures, fits ? 1 : 3);
    }
  }
}

// Interruptions only lengthen. The light is sent, and reported so, however busy the machine is.
TEST(Ws2812SpiWire, ABusyMachineIsNotASlowClock) {
  Bench bench;
  std::mt19937 random(1);
  std::exponential_distribution<double> late(1 / 300'000.0);  // ns; a slow clock adds 56,000
  bench.port.noise_ns = [&] { return static_cast<std::int64_t>(late(random)); };
  SpiWire wire = bench.wire();
  ASSERT_EQ(wire.prepare(8), "");
  for (int i = 0; i < 2000; ++i) ASSERT_EQ(wire.send(kDark), "") << i;
  EXPECT_THAT(wire.note(), HasSubstr("or a busy machine"));
}

// When three late ones prove to be the machine's fault, the clock may have been off for a moment.
TEST(Ws2812SpiWire, AfterAMeasurementTheLightIsSentOnceMore) {
  Bench bench;
  SpiWire wire = bench.wire();
  ASSERT_EQ(wire.prepare(8), "");
  bench.port.odd_hz = {1.28e6, 1.28e6, 1.28e6};
  EXPECT_EQ(wire.send(kDark), "");
  EXPECT_EQ(bench.port.pictures, 4);
}

// spidev's ioctl answers ESHUTDOWN once its device is unbound (spidev_sync in
// drivers/spi/spidev.c). An error on the bus is different.
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

TEST(Spidev, AnAbsentDeviceIsNamedWithTheFix) {
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
