#include "hal/gpiod/power_switch.hpp"

#include <fmt/format.h>

#include <cstring>
#include <stdexcept>
#include <utility>

namespace dtact::hal::gpiod {

PowerSwitch::PowerSwitch(std::unique_ptr<OutputLine> line, int settle_ms, base::Clock& clock)
    : line_(std::move(line)) {
  if (const int error = line_->set(true); error != 0) {
    throw std::runtime_error(fmt::format(
        "ring.ws2812.power: the line cannot be driven ({}): check that it is an output of the chip",
        std::strerror(error)));
  }
  clock.sleep_until(clock.monotonic_ns() + std::int64_t{settle_ms} * 1'000'000);
}

PowerSwitch::~PowerSwitch() {
  // In a destructor an error cannot be reported, and releasing the line follows anyway.
  if (!leave_on_) (void)line_->set(false);
}

}  // namespace dtact::hal::gpiod
