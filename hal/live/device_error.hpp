#pragma once

#include <stdexcept>
#include <string>

#include "hal/camera.hpp"

namespace dtact::hal::live {

/// Why a camera cannot be used now: a condition that may pass by itself, with the remedy.
class DeviceError : public std::runtime_error {
 public:
  DeviceError(CameraState state, const std::string& sentence)
      : std::runtime_error(sentence), state_(state) {}
  [[nodiscard]] CameraState state() const noexcept { return state_; }

 private:
  CameraState state_;
};

/// The camera is there and doesn't offer what is asked for: only another configuration, or another
/// camera, helps.
class ModeError : public DeviceError {
 public:
  explicit ModeError(const std::string& sentence) : DeviceError(CameraState::unplugged, sentence) {}
};

}  // namespace dtact::hal::live
