#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace dtact::hal::v4l2 {

/// The folder below /sys of the USB device that a video node ("/dev/video0") belongs to; empty when
/// it belongs to none.
[[nodiscard]] std::filesystem::path usb_device_of(const std::string& node);

/// Transfers that the kernel has begun with the device since it was plugged in: `urbnum`, counted
/// by usb_hcd_submit_urb() in drivers/usb/core/hcd.c. Nothing when `usb_device` is empty or gone.
[[nodiscard]] std::optional<std::uint64_t> transfers_of(const std::filesystem::path& usb_device);

}  // namespace dtact::hal::v4l2
