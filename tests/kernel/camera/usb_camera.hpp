#pragma once

#include <sys/types.h>

#include <functional>
#include <string>
#include <vector>

namespace dtact::kernel_test {

/// A fake camera that is plugged in from construction to destruction.
class UsbCamera {
 public:
  /// Starts uvcfake with these arguments. Its node appears a little later.
  explicit UsbCamera(const std::vector<std::string>& arguments);
  UsbCamera(const UsbCamera&) = delete;
  UsbCamera& operator=(const UsbCamera&) = delete;
  ~UsbCamera() { unplug(); }

  void unplug();
  void toggle_freeze() const;
  void drift() const;

 private:
  pid_t pid_ = -1;
};

/// Checks `condition` every 5 ms. False: it did not hold within `seconds`.
[[nodiscard]] bool eventually(double seconds, const std::function<bool()>& condition);

/// CLOCK_MONOTONIC in seconds.
[[nodiscard]] double now_s();

}  // namespace dtact::kernel_test
