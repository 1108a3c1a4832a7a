#pragma once

#include <string>
#include <vector>

#include "daemon/app/doctor/machine.hpp"
#include "hal/config.hpp"

namespace dtact::app {

enum class Verdict : std::uint8_t {
  good,
  note,  ///< Could be better; nothing fails for it.
  wrong  ///< The daemon will not start, or not run as configured.
};

struct Finding {
  Verdict verdict = Verdict::good;
  std::string what;  ///< What was looked at and what it is.
  std::string fix;   ///< The command, or the line and the file it belongs to. Empty when good.
};
using Findings = std::vector<Finding>;

// Each looks at one subject. What the configuration does not use is at most a note.

/// Nodes of cameras: there, permitted, at least one that captures.
[[nodiscard]] Findings check_camera(const Machine& machine, const hal::CameraConfig& camera);
/// How quick the USB port of each camera is, and whether the configured raw format fits into it.
[[nodiscard]] Findings check_usb_speed(const Machine& machine, const hal::CameraConfig& camera);
/// A heap of cached memory for libcamera's frames.
[[nodiscard]] Findings check_dma_heap(const Machine& machine, const hal::CameraConfig& camera);
/// libcamera's image processing modules, without one of which it takes no CSI camera.
[[nodiscard]] Findings check_ipa(const Machine& machine, const hal::CameraConfig& camera);
/// spidev: there, permitted, a speed inside the WS2812B's window, bufsiz, the true rate.
[[nodiscard]] Findings check_spi(const Machine& machine, const hal::RingConfig& ring);
/// What makes the SPI rate of a Raspberry Pi 3 or 4 move: the core clock.
[[nodiscard]] Findings check_core_clock(const Machine& machine, const hal::RingConfig& ring);
/// What a Raspberry Pi's firmware says of under-voltage and heat.
[[nodiscard]] Findings check_throttling(const Machine& machine);
/// The groups that udev's rules give the devices to, and that the unit's user is in.
[[nodiscard]] Findings check_groups(const Machine& machine);
/// The device of a Raspberry Pi 5's ws2812-pio driver: there, permitted.
[[nodiscard]] Findings check_pio(const Machine& machine, const hal::RingConfig& ring);
/// GPIO chips and the configured lines: there, permitted, free.
[[nodiscard]] Findings check_gpio(const Machine& machine, const hal::RingConfig& ring);
/// RLIMIT_RTPRIO and RLIMIT_MEMLOCK.
[[nodiscard]] Findings check_realtime(const Machine& machine);
/// The share of time that the kernel leaves to all real-time threads together.
[[nodiscard]] Findings check_realtime_share(const Machine& machine);
/// Memory that is free for the daemon to lock.
[[nodiscard]] Findings check_memory(const Machine& machine);
/// A clock source that is read without a system call.
[[nodiscard]] Findings check_clock_source(const Machine& machine);
/// CPU frequency governors.
[[nodiscard]] Findings check_governor(const Machine& machine);

}  // namespace dtact::app
