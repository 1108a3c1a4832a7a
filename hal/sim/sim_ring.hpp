#pragma once

#include <memory>
#include <utility>

#include "hal/sim/light_link.hpp"

namespace dtact::hal::sim {

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
