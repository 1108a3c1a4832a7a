// GPIO lines on the real character device and gpio-sim, whose sysfs files report a line's level.
// Runs in the guest.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hal/base/unique_fd.hpp"
#include "hal/gpiod/lines.hpp"
#include "hal/ws2812/ring.hpp"
#include "tests/kernel/ring/guest.hpp"

namespace dtact::hal {
namespace {

using kernel_test::AsNobody;
using kernel_test::read_text;
using kernel_test::write_text;
using testing::HasSubstr;

/// A simulated chip of nine lines, labelled "dtact-test", for the test program's life.
class Chip : public testing::Environment {
 public:
  void SetUp() override {
    const std::string config = "/sys/kernel/config/gpio-sim/dtact";
    std::filesystem::create_directories(config + "/bank0");
    write_text(config + "/bank0/num_lines", "9");
    write_text(config + "/bank0/label", "dtact-test");
    std::filesystem::create_directories(config + "/bank0/line1");
    write_text(config + "/bank0/line1/name", "RING_POWER");
    // The kernel itself holds a line, as for a device tree's hog.
    std::filesystem::create_directories(config + "/bank0/line7/hog");
    write_text(config + "/bank0/line7/hog/name", "lcd-reset");
    write_text(config + "/bank0/line7/hog/direction", "output-low");
    std::filesystem::create_directories(config + "/bank0/line8/hog");
    write_text(config + "/bank0/line8/hog/direction", "output-low");
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
  /// The kernel's flags of a line (GPIO_V2_LINE_FLAG_...), independent of the libgpiod version.
  static std::uint64_t flags(unsigned line) {
    const base::UniqueFd fd(::open(("/dev/" + name()).c_str(), O_RDONLY | O_CLOEXEC));
    gpio_v2_line_info info{};
    info.offset = line;
    if (::ioctl(fd.get(), GPIO_V2_GET_LINEINFO_IOCTL, &info) != 0) ADD_FAILURE();
    return info.flags;
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

TEST(GpioSim, ALineIsFoundByItsName) {
  const auto line = gpiod::open_output({.name = "RING_POWER"}, true, "key");
  EXPECT_TRUE(Chip::level(1));
  EXPECT_THAT(refusal_of({.chip = "dtact-test", .name = "RING_POWER"}), HasSubstr("in use by"));
  EXPECT_THAT(refusal_of({.name = "RING"}), HasSubstr("line \"RING\": no line has this name"));
}

TEST(GpioSim, ALinkIsItsChipAndNoSecondOne) {
  const std::string link = "/dev/gpiochip40";
  std::filesystem::create_symlink(Chip::name(), link);
  {
    const auto line = gpiod::open_output({.chip = "gpiochip40", .line = 2}, true, "key");
    EXPECT_TRUE(Chip::level(2));
    const auto named = gpiod::open_output({.name = "RING_POWER"}, false, "key");
    EXPECT_EQ(gpiod::list_chips().size(), 1U);
  }
  std::filesystem::remove(link);
}

TEST(GpioSim, TheBiasReachesTheKernelAndTheChip) {
  constexpr std::uint64_t kBias = GPIO_V2_LINE_FLAG_BIAS_PULL_UP |
                                  GPIO_V2_LINE_FLAG_BIAS_PULL_DOWN |
                                  GPIO_V2_LINE_FLAG_BIAS_DISABLED;
  const std::vector<std::pair<std::string, std::uint64_t>> expected{
      {"as-is", 0},
      {"pull-up", GPIO_V2_LINE_FLAG_BIAS_PULL_UP},
      {"pull-down", GPIO_V2_LINE_FLAG_BIAS_PULL_DOWN},
      {"disabled", GPIO_V2_LINE_FLAG_BIAS_DISABLED}};
  for (const auto& [bias, flag] : expected) {
    const auto line =
        gpiod::open_output({.chip = "dtact-test", .line = 0, .bias = bias}, false, "key");
    EXPECT_EQ(Chip::flags(0) & kBias, flag) << bias;
    EXPECT_FALSE(Chip::level(0)) << "driven, whatever pulls";
    // The simulated chip has both resistors and cannot disconnect them.
    if (bias.starts_with("pull")) {
      EXPECT_EQ(read_text(Chip::sysfs() + "/sim_gpio0/pull"), bias + "\n");
    }
  }
}

TEST(GpioSim, TheChipsAreListed) {
  const auto chips = gpiod::list_chips();
  ASSERT_EQ(chips.size(), 1U);
  EXPECT_EQ(chips[0].path, "/dev/" + Chip::name());
  EXPECT_EQ(chips[0].label, "dtact-test");
  EXPECT_EQ(chips[0].lines, 9);
  EXPECT_THAT(chips[0].names, testing::ElementsAre("", "RING_POWER", "", "", "", "", "", "", ""));
}

TEST(GpioSim, RefusalsNameTheReasonAndTheFix) {
  EXPECT_THAT(refusal_of({"dtact-test", 9, false}), HasSubstr("it has lines 0 … 8"));
  EXPECT_THAT(refusal_of({"gpiochip99", 1, false}), HasSubstr("(dtact-test, 9 lines)"));
  const auto held = gpiod::open_output({"dtact-test", 3, false}, false, "key");
  EXPECT_THAT(refusal_of({"dtact-test", 3, false}), HasSubstr("in use by \"dtactd\""));
  EXPECT_THAT(refusal_of({"dtact-test", 7, false}), HasSubstr("in use by \"lcd-reset\""));
  EXPECT_THAT(refusal_of({"dtact-test", 8, false}),
              HasSubstr("in use by something that gave no name"));
  EXPECT_EQ(gpiod::line_holder("/dev/" + Chip::name(), 2), "");
  EXPECT_EQ(gpiod::line_holder("/dev/" + Chip::name(), 8), "something that gave no name");
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

}  // namespace
}  // namespace dtact::hal
