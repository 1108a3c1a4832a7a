#pragma once

#include <string>

#include "hal/live/device_error.hpp"

namespace dtact::hal::v4l2 {

using live::DeviceError;
using live::ModeError;

/// The error of a failed system call on a camera. `what` says what was tried ("start the stream"),
/// `node` on which file. Busy, permission and bandwidth get their own state and remedy; any other
/// errno counts as unplugged, since drivers report a vanished device with nearly all of them.
[[nodiscard]] DeviceError error_of(int error, const std::string& what, const std::string& node);

}  // namespace dtact::hal::v4l2
