#pragma once

#include <mutex>

#include "hal/light_ring.hpp"

namespace dtact::hal::sim {

/// What the simulated ring and the simulated camera share: the light on the layer. Any thread may
/// call either function; both hold the lock for one copy only. Until somebody shows something, all
/// LEDs are white at full brightness.
class LightLink {
 public:
  void show(const Light& light) {
    const std::lock_guard lock(mutex_);
    light_ = light;
  }
  [[nodiscard]] Light light() const {
    const std::lock_guard lock(mutex_);
    return light_;
  }

 private:
  mutable std::mutex mutex_;
  Light light_;
};

}  // namespace dtact::hal::sim
