// The wire's errors for devices that are not the driver's; tests/kernel/ring/pio_ring_test.cpp has
// the driver's double.
#include "hal/ws2812/pio_wire.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "hal/base/atomic_file.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/ws2812/fakes.hpp"

namespace dtact::hal::ws2812 {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string refusal_of(const std::string& device) {
  test::FakeClock clock;
  return PioWire(device, clock).prepare(8);
}

TEST(Ws2812PioWire, ADeviceThatIsNotThereNamesTheOverlay) {
  EXPECT_THAT(refusal_of("/dev/leds99"),
              AllOf(HasSubstr("/dev/leds99: write failed: No such file or directory"),
                    HasSubstr("dtoverlay=ws2812-pio,gpio=<the data line's GPIO>,num_leds=8"),
                    HasSubstr("ring.backend = \"ws2812_spi\"")));
}

TEST(Ws2812PioWire, AFileIsNoDeviceAndStaysAsItIs) {
  const std::filesystem::path file = fakes::own_path();
  base::write_file_atomically(file, "mine");
  EXPECT_THAT(refusal_of(file), HasSubstr("No such device"));
  EXPECT_EQ(base::read_file(file), "mine");
  std::filesystem::remove(file);
}

TEST(Ws2812PioWire, ADeviceThatTakesEveryLengthHasMoreLeds) {
  EXPECT_THAT(refusal_of("/dev/null"),
              AllOf(HasSubstr("the driver has more than the ring's 8 LEDs"),
                    HasSubstr("set num_leds=8 in the line dtoverlay=ws2812-pio")));
}

TEST(Ws2812PioWire, AnyOtherErrorIsNamed) {
  EXPECT_THAT(refusal_of("/dev/full"), AllOf(HasSubstr("No space left"), HasSubstr("dmesg")));
}

}  // namespace
}  // namespace dtact::hal::ws2812
