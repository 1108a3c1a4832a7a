// The ring on a Raspberry Pi 5's LED driver. Runs in the guest, with ws2812-pio-mock loaded: a
// double that answers like drivers/misc/ws2812-pio-rp1.c and records what would light the LEDs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "hal/registry.hpp"
#include "hal/ws2812/pio_wire.hpp"
#include "tests/kernel/ring/guest.hpp"
#include "tests/unit/ws2812/fakes.hpp"

namespace dtact::hal {
namespace {

using kernel_test::AsNobody;
using kernel_test::eventually;
using kernel_test::read_text;
using kernel_test::write_text;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kMock = "/sys/kernel/debug/ws2812_pio_mock/";
const std::string kDriver = "/sys/bus/platform/drivers/ws2812-pio-rp1/";
constexpr const char* kDark = "000000 000000 000000 000000 000000 000000 000000 000000";
constexpr const char* kRainbow = "ff0000 00ff00 0000ff 010204 081020 408055 aa0709 ffffff";
// Offset, bytes and first byte of each write: a byte alone is the brightness, 36 ask for a ninth
// LED, 32 are the chain, dark and then the rainbow.
const std::vector<std::string> kFromTheStart{"0 1 00", "0 36 00", "0 32 00", "0 32 ff"};

Light rainbow() {
  Light light;
  light.leds = {Rgb{255, 0, 0}, Rgb{0, 255, 0},   Rgb{0, 0, 255}, Rgb{1, 2, 4},
                Rgb{8, 16, 32}, Rgb{64, 128, 85}, Rgb{170, 7, 9}, Rgb{255, 255, 255}};
  return light;
}

std::vector<std::string> recorded(const std::string& log) {
  std::ifstream file(kMock + log);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

bool last_sent(const std::string& colours) {
  return eventually([&] {
    const auto sent = recorded("sent");
    return !sent.empty() && sent.back() == colours;
  });
}

void remove_driver() { write_text(kDriver + "unbind", "ws2812-pio-rp1"); }
void probe_driver() { write_text(kDriver + "bind", "ws2812-pio-rp1"); }

/// Loads the overlay again with `leds` LEDs.
void reload(int leds) {
  remove_driver();
  write_text("/sys/module/ws2812_pio_mock/parameters/num_leds", std::to_string(leds));
  probe_driver();
}

Config pio_config() {
  Config config;
  config.camera.backend = "null";
  config.ring.backend = "ws2812_pio";
  config.ring.ws2812.resend_ms = 0;
  return config;
}

std::unique_ptr<LightRing> open_ring(const Config& config = pio_config()) {
  return std::move(open_devices(config).ring);
}

std::string refusal_of(const std::string& device) {
  return ws2812::PioWire(device).prepare(kLedCount);
}

class PioRing : public testing::Test {
 protected:
  void SetUp() override {
    reload(8);
    write_text(kMock + "sent", "0");
  }
  // There an open file that outlives the driver points to freed memory.
  void TearDown() override { EXPECT_EQ(read_text(kMock + "late"), "0\n"); }
};

TEST_F(PioRing, TheColoursArriveAndTheEndIsDark) {
  {
    const auto ring = open_ring();
    EXPECT_EQ(ring->info().backend, "ws2812_pio");
    EXPECT_EQ(ring->info().identity, "/dev/leds0");
    const ShowResult result = ring->show(rainbow());
    ASSERT_TRUE(result.ok) << result.message;
    EXPECT_TRUE(last_sent(kRainbow));
  }
  EXPECT_TRUE(last_sent(kDark));
  for (const std::string& colours : recorded("sent")) {
    EXPECT_THAT(colours, testing::AnyOf(kDark, kRainbow)) << "nothing else was ever shown";
  }
}

TEST_F(PioRing, TheBrightnessIsSetToZeroFirst) {
  const auto ring = open_ring();
  ASSERT_TRUE(ring->show(rainbow()).ok);
  EXPECT_EQ(recorded("writes"), kFromTheStart);
}

TEST_F(PioRing, OrderGammaAndBudgetAreTheRings) {
  Config config = pio_config();
  config.ring.ws2812.first_led = 2;
  config.ring.ws2812.clockwise = false;
  config.ring.ws2812.gamma = 2;
  const auto ring = open_ring(config);
  Light light = rainbow();
  light.brightness = 128;  // (128 / 255)^2 = 0.252
  ASSERT_TRUE(ring->show(light).ok);
  EXPECT_TRUE(last_sent("000040 004000 400000 404040 2b0202 102015 020408 010101"));
  config.ring.ws2812.current_budget_ma = 67;  // of 8 + 472 at full white: an eighth
  const auto scarce = open_ring(config);
  const ShowResult result = scarce->show(Light{});
  EXPECT_TRUE(result.ok);
  EXPECT_THAT(result.message, HasSubstr("ring.ws2812.current_budget_ma = 67"));
  EXPECT_TRUE(last_sent("1f1f1f 1f1f1f 1f1f1f 1f1f1f 1f1f1f 1f1f1f 1f1f1f 1f1f1f"));
}

TEST_F(PioRing, AnotherCountOfLedsIsReported) {
  for (const int leds : {1, 7}) {
    reload(leds);
    EXPECT_THAT(refusal_of("/dev/leds0"),
                AllOf(HasSubstr("/dev/leds0: the driver has fewer than the ring's 8 LEDs"),
                      HasSubstr("num_leds=8")));
  }
  for (const int leds : {9, 60}) {
    reload(leds);
    EXPECT_THAT(refusal_of("/dev/leds0"), HasSubstr("the driver has more than the ring's 8 LEDs"));
  }
}

TEST_F(PioRing, WhatIsMissingOrForbiddenNamesTheFix) {
  EXPECT_THAT(refusal_of("/dev/leds1"), AllOf(HasSubstr("/dev/leds1"), HasSubstr("No such file"),
                                              HasSubstr("dtoverlay=ws2812-pio,gpio=")));
  const AsNobody nobody;
  EXPECT_THAT(refusal_of("/dev/leds0"),
              AllOf(HasSubstr("/dev/leds0: write failed: Permission denied"),
                    HasSubstr("usermod -aG gpio"), HasSubstr("config/udev/60-dtactd.rules")));
}

TEST_F(PioRing, ARemovedDriverIsReportedAndOneThatIsBackIsPreparedAnew) {
  const auto ring = open_ring();
  ASSERT_TRUE(ring->show(rainbow()).ok);
  remove_driver();
  const ShowResult gone = ring->show(rainbow());
  EXPECT_FALSE(gone.ok);
  EXPECT_THAT(gone.message, HasSubstr("/dev/leds0: write failed: No such file or directory"));
  EXPECT_TRUE(ring->attend(rainbow()).away);
  write_text(kMock + "sent", "0");
  probe_driver();  // its brightness is 255 again
  ASSERT_TRUE(eventually([&] { return !ring->attend(rainbow()).away; }));
  ASSERT_TRUE(ring->show(rainbow()).ok);
  EXPECT_EQ(recorded("writes"), kFromTheStart);
  EXPECT_TRUE(last_sent(kRainbow));
}

TEST_F(PioRing, ADriverThatCameBackUnseenIsPreparedAnew) {
  const auto ring = open_ring();
  reload(8);
  write_text(kMock + "sent", "0");
  ASSERT_TRUE(ring->show(rainbow()).ok);
  EXPECT_EQ(recorded("writes"), kFromTheStart);
  EXPECT_TRUE(last_sent(kRainbow));
}

TEST_F(PioRing, ADriverThatCameBackWithAnotherCountIsReported) {
  const auto ring = open_ring();
  reload(12);
  const ShowResult result = ring->show(rainbow());
  EXPECT_FALSE(result.ok);
  EXPECT_THAT(result.message, HasSubstr("more than the ring's 8 LEDs"));
  EXPECT_TRUE(ring->attend(rainbow()).away);
}

// The driver sends once write() has returned, so the next write waits for the chain: HZ / 20 for
// the brightness, and for eight LEDs of 30 µs plus 300 µs until they accept a new chain.
TEST_F(PioRing, AWriteWaitsForTheChain) {
  ws2812::test::FakeClock clock;
  ws2812::PioWire wire("/dev/leds0", clock);
  ASSERT_EQ(wire.prepare(8), "");
  EXPECT_EQ(clock.now, 60'001'000);
  ASSERT_EQ(wire.send(rainbow().leds), "");
  EXPECT_EQ(clock.now, 60'541'000);
  EXPECT_THAT(wire.note(), IsEmpty());
}

}  // namespace
}  // namespace dtact::hal
