#pragma once

#include <sys/ioctl.h>

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "hal/live/source.hpp"

namespace dtact::hal::v4l2 {

/// ioctl() that is tried again when a signal interrupts it. Returns 0 or the errno.
template <typename Argument>
[[nodiscard]] int call(int fd, unsigned long request, Argument& argument) noexcept {
  while (::ioctl(fd, request, &argument) == -1) {
    if (errno != EINTR) return errno;
  }
  return 0;
}

using live::DeviceError;
using live::ModeError;

/// The error of a failed system call on a camera. `what` names the action ("start the stream"),
/// `node` the file. Busy, permission and bandwidth get their own state and fix; any other
/// errno counts as unplugged, since drivers report a vanished device with nearly all of them.
[[nodiscard]] DeviceError error_of(int error, const std::string& what, const std::string& node);

/// The folder below /sys of the USB device that a video node ("/dev/video0") belongs to; empty when
/// it belongs to none.
[[nodiscard]] std::filesystem::path usb_device_of(const std::string& node);

/// Transfers that the kernel has begun with the device since it was plugged in: `urbnum`, counted
/// by usb_hcd_submit_urb() in drivers/usb/core/hcd.c. Nothing when `usb_device` is empty or gone.
[[nodiscard]] std::optional<std::uint64_t> transfers_of(const std::filesystem::path& usb_device);

}  // namespace dtact::hal::v4l2
