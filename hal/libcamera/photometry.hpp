#pragma once

#include <libcamera/controls.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "hal/camera.hpp"
#include "hal/config.hpp"

namespace dtact::hal::libcamera_backend {

/// What a camera's frames say about the controls they were taken with, by control id; reals in
/// thousandths.
using Readings = std::map<unsigned, std::int64_t>;

/// The photometric lock over libcamera: the automatics off, the rest set to the configured value or
/// the camera's default, the frame's duration as camera.fps says. Values in CameraControl are
/// libcamera's, reals in thousandths, times in microseconds.
class PhotometricLock {
 public:
  /// Throws std::runtime_error naming the key, also for an exposure longer than a frame.
  PhotometricLock(const LibcameraConfig& config, double fps);

  /// What to hand to the camera at its start, and the controls as they are reported until the first
  /// frames say what came of it.
  struct RequestedControls {
    libcamera::ControlList list;
    std::vector<CameraControl> controls;
  };
  [[nodiscard]] RequestedControls requested_controls(
      const libcamera::ControlInfoMap& offered) const;

  /// Exposure and gain, as far as the camera has them and `controls` says their values.
  [[nodiscard]] CameraSettings settings(const libcamera::ControlInfoMap& offered,
                                        const std::vector<CameraControl>& controls) const;
  /// What to hand to the camera for `change`. `controls` get the values asked for.
  [[nodiscard]] static libcamera::ControlList changed_controls(
      const CameraChange& change, std::vector<CameraControl>& controls);

  /// Renews the values of `settings` from `controls`.
  static void read_back(const std::vector<CameraControl>& controls, CameraSettings& settings);

  /// The readings of the controls that matter, out of a frame's metadata.
  static void read(const libcamera::ControlList& metadata, Readings& readings);

  /// Compares the readings of frames that were taken with what was asked for, and notes it in
  /// `controls`: at first what each has become, with the nearest that the sensor has as its value
  /// or with the fix where it is something else. Returns the sentence that says which locked
  /// ones have moved since; empty when none.
  [[nodiscard]] static std::string compare(const Readings& readings,
                                           std::vector<CameraControl>& controls);

 private:
  LibcameraConfig config_;
  double exposure_us_;
  double fps_;
};

}  // namespace dtact::hal::libcamera_backend
