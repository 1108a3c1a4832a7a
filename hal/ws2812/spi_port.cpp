#include "hal/ws2812/spi_port.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/spi/spidev.h>
#include <sys/ioctl.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace dtact::hal::ws2812 {
namespace {

/// spidev copies each transfer through a buffer of this module parameter's size.
std::size_t read_bufsiz() {
  std::size_t bytes = 0;
  std::ifstream file("/sys/module/spidev/parameters/bufsiz");
  return file >> bytes && bytes > 0 ? bytes : 4096;  // the kernel's default
}

}  // namespace

std::string spi_remedy(int error) {
  switch (error) {
    case EACCES:
    case EPERM:
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
        fmt::format("{}: {}: {}: {}", device_, what, std::strerror(error), spi_remedy(error)));
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

}  // namespace dtact::hal::ws2812
