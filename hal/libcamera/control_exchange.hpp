#pragma once

#include <libcamera/controls.h>

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "hal/camera.hpp"
#include "hal/libcamera/photometry.hpp"

namespace dtact::hal::libcamera_backend {

/// Until what was set shows in the frames: a sensor takes two to three, before which the buffers of
/// the queue are filled.
inline constexpr int kSettlingFrames = 16;

/// Carries changed controls to the requests, and the readings of the frames back. The capture
/// thread calls add_changes() and read(), which do not wait; the threads that watch and change
/// controls call the rest.
class ControlExchange {
 public:
  /// Asks for `change`. `controls` get the values asked for.
  void change(const CameraChange& change, std::vector<CameraControl>& controls);
  /// Adds to the controls of the next request what was asked for since the last one.
  void add_changes(libcamera::ControlList& request) noexcept;
  /// Notes the readings of a frame.
  void read(const libcamera::ControlList& metadata) noexcept;

  [[nodiscard]] bool has_readings() const;
  /// Whether kSettlingFrames have been read since the start and since a request took the last
  /// change.
  [[nodiscard]] bool settled() const;
  /// PhotometricLock::compare() with the newest readings. Until they are settled it leaves
  /// `controls` alone, since the frames may still be those of before.
  [[nodiscard]] std::string compare(std::vector<CameraControl>& controls) const;

 private:
  mutable std::mutex mutex_;
  Readings readings_;
  std::optional<libcamera::ControlList> changed_;  // for the next request
  int frames_to_settle_ = kSettlingFrames;
};

}  // namespace dtact::hal::libcamera_backend
