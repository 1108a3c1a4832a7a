#pragma once

#include <iosfwd>

#include "hal/config.hpp"

namespace dtact::app {

/// `dtactd --doctor`: looks at what the configuration needs of this machine (camera nodes, SPI and
/// GPIO with their permissions, SPI rate, real-time limits, clock source) and prints one line for
/// each thing looked at; under what is wrong, the command that mends it. Changes nothing: the
/// SPI's true rate is measured with zeros, which LEDs ignore. Returns the exit status: 0 when
/// nothing is wrong, else 1.
[[nodiscard]] int doctor(const hal::Config& config, std::ostream& out);

}  // namespace dtact::app
