#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/camera.hpp"
#include "hal/config.hpp"

namespace dtact::hal::v4l2 {

/// A control as a device offers it.
struct OfferedControl {
  std::string name;  ///< As v4l2-ctl says it: "exposure_time_absolute".
  std::int64_t minimum = 0;
  std::int64_t maximum = 0;
  std::int64_t step = 1;
  std::int64_t initial = 0;  ///< The driver's default.
  std::int64_t value = 0;
};

/// The controls of the photometric lock that the device at `fd` has.
[[nodiscard]] std::vector<OfferedControl> list_controls(int fd);

/// The photometric lock: everything that would change the picture by itself is switched off, and
/// what is left is set to the configured value, or to the camera's default so that every start is
/// like the other.
class PhotometricLock {
 public:
  /// Throws std::runtime_error naming the key when a control is not one of the lock's, when two
  /// keys contradict, or when a value is impossible.
  explicit PhotometricLock(const V4l2Config& config);

  /// Sets every control of the device and reads it back. Never throws for what the camera refuses:
  /// the entry's note says it.
  [[nodiscard]] std::vector<CameraControl> apply(int fd) const;

  /// Reads the locked ones of `controls` again, and sets again what has moved. Returns the sentence
  /// that says what moved; empty when nothing did.
  [[nodiscard]] std::string check(int fd, std::vector<CameraControl>& controls) const;

 private:
  V4l2Config config_;
  double exposure_us_ = 0;  // 0 = the camera's default
};

}  // namespace dtact::hal::v4l2
