#include "hal/ws2812/pio_wire.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "hal/base/device_allow.hpp"
#include "hal/base/unique_fd.hpp"
#include "hal/ws2812/encoder.hpp"

namespace dtact::hal::ws2812 {
namespace {

constexpr std::size_t kPixelBytes = 4;
constexpr std::int64_t kLedNs = 30'000;  // 24 bits at 800 kHz
// A write that does not end at the last LED is sent HZ / 20 later; this applies to the first
// brightness. What is written meanwhile waits with it. A tick more, for the slowest kernel's.
constexpr std::int64_t kIncompleteNs = 60'000'000;

/// The node went with the driver, or is there without it.
bool is_gone(int error) { return error == ENOENT || error == ENODEV || error == ENXIO; }

}  // namespace

PioWire::PioWire(std::string device, base::Clock& clock)
    : device_(std::move(device)), clock_(clock) {}

std::string PioWire::prepare(int leds) {
  const std::size_t chain = static_cast<std::size_t>(leds) * kPixelBytes;
  const std::vector<std::uint8_t> dark(chain + kPixelBytes, 0);
  const auto other_count = [&](const char* found) {
    return fmt::format(
        "{}: the driver has {} than the ring's {} LEDs: set num_leds={} in the line "
        "dtoverlay=ws2812-pio of /boot/firmware/config.txt, then reboot",
        device_, found, leds, leds);
  };
  if (const int error = write(std::span(dark).first(1)); error != 0) return failed(error);
  const int longer = write(dark);
  if (longer == 0) return other_count("more");
  if (longer != EFBIG) return failed(longer);
  const int error = write(std::span(dark).first(chain));
  if (error == EFBIG) return other_count("fewer");
  if (error != 0) return failed(error);
  wait(kIncompleteNs);
  return {};
}

std::string PioWire::send(std::span<const Rgb> leds) {
  struct stat status{};
  if (::stat(device_.c_str(), &status) == 0 && status.st_ino != node_) {
    std::string refused = prepare(static_cast<int>(leds.size()));
    lost_ = !refused.empty();
    if (lost_) return refused;
  }
  std::vector<std::uint8_t> bytes;
  bytes.reserve(leds.size() * kPixelBytes);
  for (const Rgb& led : leds) bytes.insert(bytes.end(), {led.r, led.g, led.b, 0});
  const int error = write(bytes);
  lost_ = is_gone(error);
  if (error != 0) return failed(error);
  // The driver pauses for 50 µs after a chain, newer LEDs need 280 to take the next for a new one.
  wait(static_cast<std::int64_t>(leds.size()) * kLedNs + static_cast<std::int64_t>(kLatchNs));
  return {};
}

int PioWire::write(std::span<const std::uint8_t> bytes) noexcept {
  const base::UniqueFd fd(::open(device_.c_str(), O_WRONLY | O_CLOEXEC));
  struct stat status{};
  if (!fd || ::fstat(fd.get(), &status) != 0) return errno;
  if (!S_ISCHR(status.st_mode)) return ENODEV;
  node_ = status.st_ino;
  const ssize_t written = ::write(fd.get(), bytes.data(), bytes.size());
  if (written < 0) return errno;
  return written == static_cast<ssize_t>(bytes.size()) ? 0 : EIO;
}

std::string PioWire::failed(int error) const {
  const char* fix = "see the kernel's log (dmesg) for the driver's own words";
  if (error == EPERM) {
    fix = base::kDeviceAllowFix;
  } else if (error == EACCES) {
    fix =
        "put the user into the group that owns it (sudo usermod -aG gpio <user>) and install "
        "config/udev/60-dtactd.rules";
  } else if (is_gone(error)) {
    fix =
        "on a Raspberry Pi 5 put dtoverlay=ws2812-pio,gpio=<the data line's GPIO>,num_leds=8 into "
        "/boot/firmware/config.txt and reboot (dmesg says why when it is there already); other "
        "boards have no such driver: ring.backend = \"ws2812_spi\"";
  }
  return fmt::format("{}: write failed: {}: {}", device_, std::strerror(error), fix);
}

}  // namespace dtact::hal::ws2812
