#include "hal/ws2812/spi_wire.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/spi/spidev.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "hal/base/device_allow.hpp"

namespace dtact::hal::ws2812 {
namespace {

/// spidev copies each transfer through a buffer of this module parameter's size.
std::size_t read_bufsiz() {
  std::size_t bytes = 0;
  std::ifstream file("/sys/module/spidev/parameters/bufsiz");
  return file >> bytes && bytes > 0 ? bytes : 4096;  // the kernel's default
}

}  // namespace

std::string spi_fix(int error) {
  switch (error) {
    case EPERM:
      return base::kDeviceAllowFix;
    case EACCES:
      return "put the user into the group that owns it (sudo usermod -aG spi <user>) and install "
             "config/udev/60-dtactd.rules";
    case ENOENT:
    case ENODEV:
    case ENXIO:
    case ESHUTDOWN:
      return "turn the SPI controller on (on a Raspberry Pi: dtparam=spi=on in "
             "/boot/firmware/config.txt, then reboot) or name another device in "
             "ring.ws2812.spi_device";
    case EMSGSIZE:
      return "raise spidev.bufsiz on the kernel's command line";
    case EBUSY:
      return "another program holds it: find it with fuser -v";
    default:
      return "see the kernel's log (dmesg) for the SPI controller's own words";
  }
}

Spidev::Spidev(const std::string& device, std::uint32_t hz)
    : device_(device),
      hz_(hz),
      max_bytes_(read_bufsiz()),
      fd_(::open(device.c_str(), O_RDWR | O_CLOEXEC)) {
  const auto fail = [&](int error, const char* what) {
    throw std::runtime_error(
        fmt::format("{}: {}: {}: {}", device_, what, std::strerror(error), spi_fix(error)));
  };
  if (!fd_) fail(errno, "cannot be opened");
  std::uint8_t mode = SPI_MODE_0;
  std::uint8_t word = 8;
  if (::ioctl(fd_.get(), SPI_IOC_WR_MODE, &mode) != 0) fail(errno, "refuses mode 0");
  if (::ioctl(fd_.get(), SPI_IOC_WR_BITS_PER_WORD, &word) != 0) fail(errno, "refuses 8-bit words");
  if (::ioctl(fd_.get(), SPI_IOC_WR_MAX_SPEED_HZ, &hz_) != 0) fail(errno, "refuses the speed");
}

int Spidev::transfer(std::span<const std::uint8_t> bytes) noexcept {
  spi_ioc_transfer transfer{};
  transfer.tx_buf = reinterpret_cast<std::uintptr_t>(bytes.data());
  transfer.len = static_cast<std::uint32_t>(bytes.size());
  transfer.speed_hz = hz_;
  transfer.bits_per_word = 8;
  return ::ioctl(fd_.get(), SPI_IOC_MESSAGE(1), &transfer) >= 0 ? 0 : errno;
}

namespace {

// At 3.2 MHz 4096 bytes last 10 ms, of which an interruption of 50 µs is half a percent.
constexpr std::size_t kLongestProbe = 16384;
constexpr std::size_t kProbes = 8;
// A larger deviation gets a note although the pulses still fit.
constexpr double kReportedDeviation = 0.03;

// Transfers that are off in a row before the clock is suspected.
constexpr int kConsecutive = 3;

// What makes the clock run off on a Raspberry Pi: the SPI clock is divided from the core clock
// (spi-bcm2835.c), which the firmware scales with load, and the divider is set for one of its
// values. A Pi 4 ignores core_freq=250 and falls to 200 at idle unless core_freq_min holds it
// (README of jgarff/rpi_ws281x; rpi-ws281x/rpi-ws281x-python#35).
constexpr const char* kFix =
    "on a Raspberry Pi hold the core clock still in /boot/firmware/config.txt and reboot (Pi 4: "
    "core_freq=500 and core_freq_min=500, Pi 3: core_freq=250, or on either force_turbo=1); "
    "elsewhere ring.ws2812.spi_bits = 8 with spi_hz = 8000000 stands the most, a clock that falls "
    "to 63 %";

}  // namespace

MeasuredRate measure_rate(SpiPort& port, base::Clock& clock) {
  const std::size_t longer = std::min(port.max_bytes(), kLongestProbe);
  const std::array<std::size_t, 2> lengths{longer / 4, longer};
  const std::vector<std::uint8_t> zeros(longer, 0);
  std::array<std::array<std::int64_t, kProbes>, 2> took{};
  for (std::size_t probe = 0; probe < kProbes; ++probe) {
    for (std::size_t i = 0; i < lengths.size(); ++i) {
      const std::int64_t start = clock.monotonic_ns();
      if (const int e = port.transfer(std::span(zeros).first(lengths[i])); e != 0) return {0, e};
      took[i][probe] = clock.monotonic_ns() - start;
    }
  }
  for (auto& times : took) std::ranges::sort(times);
  const double seconds = static_cast<double>(took[1][0] - took[0][0]) * 1e-9;
  if (seconds <= 0) return {};
  const double hz = static_cast<double>(8 * (lengths[1] - lengths[0])) / seconds;
  const double wire_ns = static_cast<double>(8 * lengths[0]) / hz * 1e9;
  return {hz, 0, static_cast<double>(took[0][kProbes / 2]) - wire_ns};
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
      asked.hz / 1e6, measured_hz / 1e6, outside, kFix);
}

SpiWire::SpiWire(std::unique_ptr<SpiPort> port, const SpiFormat& format, bool check_rate,
                 base::Clock& clock)
    : port_(std::move(port)), format_(format), check_rate_(check_rate), clock_(clock) {}

std::string SpiWire::prepare(int leds) {
  const std::vector<Rgb> dark(static_cast<std::size_t>(leds));
  if (const std::size_t need = encode(dark, format_).size(); need > port_->max_bytes()) {
    return fmt::format(
        "{}: {} LEDs need {} bytes in one transfer and spidev takes {}: put spidev.bufsiz={} on "
        "the kernel's command line",
        port_->name(), leds, need, port_->max_bytes(), std::max<std::size_t>(4096, need));
  }
  return check_rate_ ? check_rate() : std::string();
}

std::string SpiWire::note() const {
  if (again_ == 0) return deviation_;
  return fmt::format(
      "{}{}{}: {} of {} transfers were off and sent again, the last {}: the clock, or a busy "
      "machine",
      deviation_, deviation_.empty() ? "" : "; ", port_->name(), again_, sent_, last_off_);
}

std::string SpiWire::send(std::span<const Rgb> leds) {
  lost_ = false;
  const std::vector<std::uint8_t> bytes = encode(leds, format_);
  const RateWindow window = window_of(format_.bits);
  const auto bits = static_cast<double>(8 * bytes.size());
  for (int i = 0; i < kConsecutive; ++i) {
    const Timed timed = transfer(bytes);
    if (timed.error != 0) return gave_up(timed.error);
    const double ns = timed.ns - overhead_ns_;
    if (!check_rate_ || (ns >= bits / window.fastest * 1e9 && ns <= bits / window.slowest * 1e9)) {
      return {};
    }
    ++again_;
    last_off_ = fmt::format("{:.2f} ms for {:.2f} ms", timed.ns * 1e-6,
                            (bits / format_.hz * 1e9 + overhead_ns_) * 1e-6);
  }
  if (std::string refused = check_rate(); !refused.empty()) {
    lost_ = true;
    return refused;
  }
  // The clock is right, now at least. It may have been off a moment ago.
  return gave_up(transfer(bytes).error);
}

SpiWire::Timed SpiWire::transfer(std::span<const std::uint8_t> bytes) noexcept {
  ++sent_;
  const std::int64_t start = clock_.monotonic_ns();
  const int error = port_->transfer(bytes);
  return {error, static_cast<double>(clock_.monotonic_ns() - start)};
}

std::string SpiWire::check_rate() {
  const MeasuredRate rate = measure_rate(*port_, clock_);
  if (rate.error != 0) return gave_up(rate.error);
  if (const std::string refused = why_rate_refused(format_, rate.hz); !refused.empty()) {
    return fmt::format("{}: {}", port_->name(), refused);
  }
  overhead_ns_ = rate.overhead_ns;
  const double off = rate.hz / format_.hz - 1;
  deviation_.clear();
  if (std::abs(off) > kReportedDeviation) {
    deviation_ = fmt::format("{}: asked for {:.3f} MHz, measured {:.3f} MHz ({:+.1f} %); {}",
                             port_->name(), format_.hz / 1e6, rate.hz / 1e6, off * 100, kFix);
  }
  return {};
}

std::string SpiWire::gave_up(int error) {
  // What spidev answers once its device has gone, or its controller with it.
  lost_ = error == ESHUTDOWN || error == ENODEV || error == ENXIO;
  if (error == 0) return {};
  return fmt::format("{}: write failed: {}: {}", port_->name(), std::strerror(error),
                     spi_fix(error));
}

}  // namespace dtact::hal::ws2812
