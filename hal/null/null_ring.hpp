#pragma once

#include "hal/light_ring.hpp"

namespace dtact::hal::null {

/// The ring that does nothing, for sensors whose light no computer commands.
class NullRing final : public LightRing {
 public:
  [[nodiscard]] RingInfo info() const override { return {"null", "null"}; }
  [[nodiscard]] ShowResult show(const Light& /*light*/) override { return {}; }
};

}  // namespace dtact::hal::null
