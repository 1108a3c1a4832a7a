#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "hal/light_ring.hpp"

namespace dtact::hal::sim {

/// The light on the gel, shared by the simulated ring and the simulated camera. Any thread may
/// call either function; both hold the lock for one copy only. Before the first light all
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

/// The simulated ring: the camera that shares its link sees what it shows. Dark until the first
/// show(), as a WS2812B is after power-on.
class SimRing final : public LightRing {
 public:
  explicit SimRing(std::shared_ptr<LightLink> link) : link_(std::move(link)) {
    Light dark;
    dark.brightness = 0;
    link_->show(dark);
  }

  [[nodiscard]] RingInfo info() const override { return {"sim", "sim"}; }
  [[nodiscard]] ShowResult show(const Light& light) override {
    link_->show(light);
    return {};
  }

 private:
  std::shared_ptr<LightLink> link_;
};

}  // namespace dtact::hal::sim
