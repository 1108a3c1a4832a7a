#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "hal/ws2812/gpio_wire.hpp"
#include "hal/ws2812/ring.hpp"
#include "hal/ws2812/spi_wire.hpp"

namespace dtact::hal::ws2812 {
namespace {

std::unique_ptr<gpiod::PowerSwitch> power_on(const Ws2812Config& config) {
  if (config.power.chip.empty()) return nullptr;
  return std::make_unique<gpiod::PowerSwitch>(
      gpiod::open_output(config.power, false, "ring.ws2812.power"), config.power_settle_ms);
}

}  // namespace

std::unique_ptr<LightRing> open_spi_ring(const Ws2812Config& config) {
  const SpiFormat format{config.spi_bits, static_cast<double>(config.spi_hz)};
  auto wire = std::make_unique<SpiWire>(
      std::make_unique<Spidev>(config.spi_device, static_cast<std::uint32_t>(config.spi_hz)),
      format, config.spi_check_rate);
  return std::make_unique<Ring>(std::move(wire), power_on(config), config, 0);
}

std::unique_ptr<LightRing> open_gpio_ring(const Ws2812Config& config) {
  if (config.data.chip.empty()) {
    throw std::runtime_error(
        "ring.ws2812.data.chip is empty: ring.backend = \"ws2812_gpio\" needs the chip and line of "
        "the LEDs' data line");
  }
  auto wire = std::make_unique<GpioWire>(
      gpiod::open_output(config.data, false, "ring.ws2812.data"),
      fmt::format("{} line {}", config.data.chip, config.data.line), config.gpio_retries);
  return std::make_unique<Ring>(std::move(wire), power_on(config), config, config.gpio_priority);
}

}  // namespace dtact::hal::ws2812
