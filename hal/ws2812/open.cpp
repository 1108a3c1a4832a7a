#include <fmt/format.h>

#include <functional>
#include <stdexcept>
#include <utility>

#include "hal/ws2812/encoder.hpp"
#include "hal/ws2812/pio_wire.hpp"
#include "hal/ws2812/ring.hpp"
#include "hal/ws2812/spi_wire.hpp"

namespace dtact::hal::ws2812 {
namespace {

/// What is common to every ring: its supply.
RingParts parts_of(const Ws2812Config& config, RingInfo info,
                   std::function<std::unique_ptr<Wire>()> open_wire) {
  RingParts parts{std::move(info), std::move(open_wire), {}};
  if (config.power.is_set()) {
    parts.switch_on = [power = config.power, settle_ms = config.power_settle_ms] {
      return std::make_unique<gpiod::PowerSwitch>(
          gpiod::open_output(power, false, "ring.ws2812.power"), settle_ms);
    };
  }
  return parts;
}

}  // namespace

void check_spi(const Ws2812Config& config) {
  const std::string refused = why_refused({config.spi_bits, static_cast<double>(config.spi_hz)});
  if (!refused.empty()) throw std::runtime_error(fmt::format("ring.ws2812.spi_hz: {}", refused));
}

std::unique_ptr<LightRing> open_spi_ring(const Ws2812Config& config) {
  check_spi(config);
  const SpiFormat format{config.spi_bits, static_cast<double>(config.spi_hz)};
  const auto open = [config, format]() -> std::unique_ptr<Wire> {
    return std::make_unique<SpiWire>(
        std::make_unique<Spidev>(config.spi_device, static_cast<std::uint32_t>(config.spi_hz)),
        format, config.spi_check_rate);
  };
  return std::make_unique<Ring>(parts_of(config, {"ws2812_spi", config.spi_device}, open), config);
}

std::unique_ptr<LightRing> open_pio_ring(const Ws2812Config& config) {
  const auto open = [device = config.pio_device]() -> std::unique_ptr<Wire> {
    return std::make_unique<PioWire>(device);
  };
  return std::make_unique<Ring>(parts_of(config, {"ws2812_pio", config.pio_device}, open), config);
}

}  // namespace dtact::hal::ws2812
