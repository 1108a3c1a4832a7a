#include "hal/ws2812/spi_wire.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

namespace dtact::hal::ws2812 {
namespace {

// At 3.2 MHz 4096 bytes last 10 ms, of which an interruption of 50 µs is half a percent.
constexpr std::size_t kLongestProbe = 16384;
constexpr int kProbes = 8;
// Above this a deviation is worth a note although the pulses still fit.
constexpr double kNoteworthy = 0.03;

// What makes the clock run off on a Raspberry Pi: the SPI clock is divided from the core clock,
// which the firmware scales with load, and the divider is set for one of its values.
constexpr const char* kCure =
    "on a Raspberry Pi hold the core clock still (Pi 4: core_freq=500 and core_freq_min=500, Pi 3: "
    "core_freq=250, in /boot/firmware/config.txt, then reboot)";

std::string failed(const SpiPort& port, int error) {
  return fmt::format("{}: write failed: {}: {}", port.name(), std::strerror(error),
                     spi_remedy(error));
}

}  // namespace

MeasuredRate measure_rate(SpiPort& port, base::Clock& clock) {
  const std::size_t longer = std::min(port.max_bytes(), kLongestProbe);
  const std::array<std::size_t, 2> lengths{longer / 4, longer};
  const std::vector<std::uint8_t> zeros(longer, 0);
  std::array<std::int64_t, 2> least{};
  least.fill(std::numeric_limits<std::int64_t>::max());
  for (int probe = 0; probe < kProbes; ++probe) {
    for (std::size_t i = 0; i < lengths.size(); ++i) {
      const std::int64_t start = clock.monotonic_ns();
      if (const int e = port.transfer(std::span(zeros).first(lengths[i])); e != 0) return {0, e};
      least[i] = std::min(least[i], clock.monotonic_ns() - start);
    }
  }
  const double seconds = static_cast<double>(least[1] - least[0]) * 1e-9;
  const auto bits = static_cast<double>(8 * (lengths[1] - lengths[0]));
  return {seconds > 0 ? bits / seconds : 0, 0};
}

std::string why_rate_refused(const SpiFormat& asked, double measured_hz) {
  if (measured_hz <= 0) {
    return "the transfers take no time, so nothing is clocked out: is the controller the right "
           "one?";
  }
  const std::string outside = why_refused({asked.bits, measured_hz});
  if (outside.empty()) return {};
  return fmt::format(
      "asked for {:.3f} MHz, the controller really sends {:.3f} MHz; {}. Cure: {}; where the "
      "controller merely pauses between bytes, set ring.ws2812.spi_check_rate = false",
      asked.hz / 1e6, measured_hz / 1e6, outside, kCure);
}

SpiWire::SpiWire(std::unique_ptr<SpiPort> port, const SpiFormat& format, bool check_rate,
                 base::Clock& clock)
    : port_(std::move(port)), format_(format), check_rate_(check_rate), clock_(clock) {}

RingInfo SpiWire::info() const { return {"ws2812_spi", port_->name()}; }

std::string SpiWire::prepare(int leds) {
  const std::vector<Rgb> dark(static_cast<std::size_t>(leds));
  if (const std::size_t need = encode(dark, format_).size(); need > port_->max_bytes()) {
    return fmt::format(
        "{}: {} LEDs need {} bytes in one transfer and spidev takes {}: put spidev.bufsiz={} on "
        "the kernel's command line",
        port_->name(), leds, need, port_->max_bytes(), std::max<std::size_t>(4096, need));
  }
  if (!check_rate_) return {};
  const MeasuredRate rate = measure_rate(*port_, clock_);
  if (rate.error != 0) return failed(*port_, rate.error);
  if (const std::string refused = why_rate_refused(format_, rate.hz); !refused.empty()) {
    return fmt::format("{}: {}", port_->name(), refused);
  }
  if (const double off = rate.hz / format_.hz - 1; std::abs(off) > kNoteworthy) {
    note_ = fmt::format("{}: asked for {:.3f} MHz, measured {:.3f} MHz ({:+.1f} %); {}",
                        port_->name(), format_.hz / 1e6, rate.hz / 1e6, off * 100, kCure);
  }
  return {};
}

std::string SpiWire::send(std::span<const Rgb> leds) {
  const int error = port_->transfer(encode(leds, format_));
  // What spidev answers once its device has gone, or its controller with it.
  lost_ = error == ESHUTDOWN || error == ENODEV || error == ENXIO;
  return error == 0 ? std::string() : failed(*port_, error);
}

}  // namespace dtact::hal::ws2812
