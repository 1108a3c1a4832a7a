#pragma once

#include <cstdint>

namespace dtact::net {

/// What a connection may do; the values are those of dtact.v1.Rights. Each includes the one before.
enum class Rights : std::uint8_t {
  view = 1,      ///< Subscribe, Ping and all that begins with Get and List.
  control = 2,   ///< The light, re-zero and how depth is made, too.
  calibrate = 3  ///< Everything: calibrations, too.
};

}  // namespace dtact::net
