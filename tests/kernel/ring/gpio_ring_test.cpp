// GPIO lines on the real character device and gpio-sim, whose sysfs files say what level a line
// has. Runs in the guest.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hal/gpiod/lines.hpp"
#include "hal/gpiod/power_switch.hpp"
#include "hal/ws2812/gpio_wire.hpp"
#include "hal/ws2812/ring.hpp"
#include "tests/kernel/ring/guest.hpp"
#include "tests/unit/ws2812/chain_model.hpp"

namespace dtact::hal {
namespace {

using gpiod::OutputLine;
using kernel_test::AsNobody;
using kernel_test::read_text;
using kernel_test::write_text;
using testing::ElementsAreArray;
using testing::HasSubstr;

/// A simulated chip of eight lines, labelled "dtact-test", for the test program's life.
class Chip : public testing::Environment {
 public:
  void SetUp() override {
    const std::string config = "/sys/kernel/config/gpio-sim/dtact";
    std::filesystem::create_directories(config + "/bank0");
    write_text(config + "/bank0/num_lines", "8");
    write_text(config + "/bank0/label", "dtact-test");
    write_text(config + "/live", "1");
    const auto word = [&](const std::string& file) {
      std::string text = read_text(config + file);
      text.erase(text.find_last_not_of('\n') + 1);
      return text;
    };
    name() = word("/bank0/chip_name");
    sysfs() = "/sys/devices/platform/" + word("/dev_name") + "/" + name();
  }
  static std::string& name() {
    static std::string value;
    return value;
  }
  static std::string& sysfs() {
    static std::string value;
    return value;
  }
  static bool level(int line) {
    return read_text(sysfs() + "/sim_gpio" + std::to_string(line) + "/value").front() == '1';
  }
};
const auto* const kChip = testing::AddGlobalTestEnvironment(new Chip);

std::string refusal_of(const GpioLineConfig& line) {
  try {
    (void)gpiod::open_output(line, false, "ring.ws2812.power");
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return {};
}

TEST(GpioSim, ALineIsFoundByPathNameAndLabel) {
  for (const std::string& chip :
       {"/dev/" + Chip::name(), Chip::name(), std::string("dtact-test")}) {
    const auto line = gpiod::open_output({chip, 4, false}, true, "key");
    EXPECT_TRUE(Chip::level(4)) << chip;
    EXPECT_EQ(line->set(false), 0);
    EXPECT_FALSE(Chip::level(4)) << chip;
    EXPECT_EQ(line->set(true), 0);
    EXPECT_TRUE(Chip::level(4)) << chip;
  }
}

TEST(GpioSim, ActiveLowTurnsTheLevel) {
  const auto line = gpiod::open_output({"dtact-test", 5, true}, true, "key");
  EXPECT_FALSE(Chip::level(5));
  EXPECT_EQ(line->set(false), 0);
  EXPECT_TRUE(Chip::level(5));
}

TEST(GpioSim, TheChipsAreListed) {
  const auto chips = gpiod::list_chips();
  ASSERT_EQ(chips.size(), 1U);
  EXPECT_EQ(chips[0].path, "/dev/" + Chip::name());
  EXPECT_EQ(chips[0].label, "dtact-test");
  EXPECT_EQ(chips[0].lines, 8);
}

TEST(GpioSim, RefusalsNameTheReasonAndTheRemedy) {
  EXPECT_THAT(refusal_of({"dtact-test", 8, false}), HasSubstr("it has lines 0 … 7"));
  EXPECT_THAT(refusal_of({"gpiochip99", 1, false}), HasSubstr("(dtact-test, 8 lines)"));
  const auto held = gpiod::open_output({"dtact-test", 3, false}, false, "key");
  EXPECT_THAT(refusal_of({"dtact-test", 3, false}), HasSubstr("in use by \"dtactd\""));
  const AsNobody nobody;
  EXPECT_THAT(refusal_of({"dtact-test", 2, false}), HasSubstr("usermod -aG gpio"));
  EXPECT_THAT(refusal_of({"/dev/" + Chip::name(), 2, false}), HasSubstr("Permission denied"));
}

TEST(GpioSim, PowerIsOnWhileTheRingLives) {
  Ws2812Config config;
  config.resend_ms = 0;
  config.spi_check_rate = false;
  config.power = {"dtact-test", 6, false};
  config.power_settle_ms = 30;
  {
    const std::int64_t start = base::system_clock().monotonic_ns();
    const auto ring = ws2812::open_spi_ring(config);
    EXPECT_GE(base::system_clock().monotonic_ns() - start, 30'000'000);
    EXPECT_TRUE(Chip::level(6));
    EXPECT_TRUE(ring->show(Light{}).ok);
    EXPECT_TRUE(Chip::level(6));
  }
  EXPECT_FALSE(Chip::level(6));
}

/// Drives the real line and asks the chip after every call what level it has.
class Watched final : public OutputLine {
 public:
  struct Log {
    std::vector<std::pair<bool, std::int64_t>> levels;
    int disturb_at = -1;  // the call before which this thread is held up once
    int calls = 0;
  };
  Watched(std::unique_ptr<OutputLine> line, int number, Log& log)
      : line_(std::move(line)), number_(number), log_(log) {}
  [[nodiscard]] int set(bool active) noexcept override {
    if (log_.calls++ == log_.disturb_at) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    const int error = line_->set(active);
    log_.levels.emplace_back(Chip::level(number_), base::system_clock().monotonic_ns());
    return error;
  }

 private:
  std::unique_ptr<OutputLine> line_;
  int number_;
  Log& log_;
};

// The guest's calls take tens of microseconds, and a busy machine takes its processor away for
// milliseconds, so that the protocol runs here 50,000 times slower: what is proven is the order and
// the form of the edges at a real chip, not the speed.
constexpr int kSlower = 50'000;
constexpr ws2812::PulseWindow slowed() {
  const ws2812::PulseWindow w;
  const auto s = [](std::int64_t ns) { return ns * kSlower; };
  return {s(w.zero_wait), s(w.zero_high_min), s(w.zero_high_max),
          s(w.one_wait),  s(w.one_high_min),  s(w.one_high_max),
          s(w.low_wait),  s(w.low_max),       1'000'000};
}

constexpr std::array<Rgb, 1> kLeds{Rgb{0xA5, 0x03, 0xFC}};
constexpr std::size_t kCallsAWrite = 1 + 2 * 24;

/// What LEDs would show after the last write.
std::vector<Rgb> shown_by(const Watched::Log& log) {
  ws2812::test::ChainModel chain;
  for (std::size_t i = log.levels.size() - kCallsAWrite; i + 1 < log.levels.size(); ++i) {
    const auto ns = log.levels[i + 1].second - log.levels[i].second;
    chain.level(log.levels[i].first, static_cast<double>(ns) / kSlower);
  }
  chain.level(false, 300'000);
  EXPECT_EQ(chain.odd_pulses(), 0);
  return chain.shown();
}

TEST(GpioDataLine, TheChipsEdgesAreTheColours) {
  Watched::Log log;
  ws2812::GpioWire wire(
      std::make_unique<Watched>(gpiod::open_output({"dtact-test", 7, false}, false, "key"), 7, log),
      "dtact-test line 7", 20, base::system_clock(), slowed());
  ASSERT_EQ(wire.send(kLeds), "");
  std::printf("data line at 1/%d speed: %zu levels read at the chip, %llu writes sent again\n",
              kSlower, log.levels.size(), static_cast<unsigned long long>(wire.resent()));
  EXPECT_THAT(shown_by(log), ElementsAreArray(kLeds));
}

TEST(GpioDataLine, ADisturbedWriteIsSentAgain) {
  Watched::Log log;
  log.disturb_at = 40;  // while the line is high
  ws2812::GpioWire wire(
      std::make_unique<Watched>(gpiod::open_output({"dtact-test", 7, false}, false, "key"), 7, log),
      "dtact-test line 7", 20, base::system_clock(), slowed());
  ASSERT_EQ(wire.send(kLeds), "");
  EXPECT_GE(wire.resent(), 1U);
  EXPECT_THAT(shown_by(log), ElementsAreArray(kLeds));
}

TEST(GpioDataLine, AtFullSpeedThisBoardIsRefused) {
  Ws2812Config config;
  config.data = {"dtact-test", 1, false};
  try {
    (void)ws2812::open_gpio_ring(config);
    FAIL() << "a guest kernel cannot be this fast";
  } catch (const std::runtime_error& e) {
    std::printf("refused: %s\n", e.what());
    EXPECT_THAT(e.what(), HasSubstr("too slow"));
    EXPECT_THAT(e.what(), HasSubstr("a 0's high pulse takes"));
    EXPECT_THAT(e.what(), HasSubstr("ws2812_spi"));
  }
  EXPECT_FALSE(Chip::level(1)) << "measured without a pulse";
}

}  // namespace
}  // namespace dtact::hal
