#pragma once

#include <stdexcept>
#include <string>

#include "hal/camera.hpp"

namespace dtact::hal::v4l2 {

/// Why a camera cannot be used now: a condition that may pass by itself, with the remedy.
class DeviceError : public std::runtime_error {
 public:
  DeviceError(CameraState state, const std::string& sentence)
      : std::runtime_error(sentence), state_(state) {}
  [[nodiscard]] CameraState state() const noexcept { return state_; }

 private:
  CameraState state_;
};

/// What cannot pass without another configuration: the camera doesn't offer what is asked for.
class ModeError : public DeviceError {
 public:
  explicit ModeError(const std::string& sentence) : DeviceError(CameraState::unplugged, sentence) {}
};

/// The error of a failed system call on a camera. `what` says what was tried ("start the stream"),
/// `node` on which file. Busy, permission and bandwidth get their own state and remedy; any other
/// errno counts as unplugged, since drivers report a vanished device with nearly all of them.
[[nodiscard]] DeviceError error_of(int error, const std::string& what, const std::string& node);

}  // namespace dtact::hal::v4l2
