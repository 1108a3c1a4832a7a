#pragma once

#include <memory>

#include "hal/base/clock.hpp"
#include "hal/gpiod/lines.hpp"

namespace dtact::hal::gpiod {

/// Holds a supply on from construction, which lasts until the supply has settled, to destruction.
class PowerSwitch {
 public:
  /// Throws std::runtime_error when the line cannot be driven.
  PowerSwitch(std::unique_ptr<OutputLine> line, int settle_ms,
              base::Clock& clock = base::system_clock());
  PowerSwitch(const PowerSwitch&) = delete;
  PowerSwitch& operator=(const PowerSwitch&) = delete;
  ~PowerSwitch();

  /// Destruction then leaves the line as it is.
  void leave_on() noexcept { leave_on_ = true; }

 private:
  std::unique_ptr<OutputLine> line_;
  bool leave_on_ = false;
};

}  // namespace dtact::hal::gpiod
