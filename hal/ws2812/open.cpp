#include <utility>

#include "hal/ws2812/pio_wire.hpp"
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

std::unique_ptr<LightRing> open_pio_ring(const Ws2812Config& config) {
  return std::make_unique<Ring>(std::make_unique<PioWire>(config.pio_device), power_on(config),
                                config, 0);
}

}  // namespace dtact::hal::ws2812
