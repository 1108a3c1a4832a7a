#pragma once

#include <iosfwd>

#include "daemon/app/doctor/machine.hpp"
#include "hal/config.hpp"

namespace dtact::app {

/// `dtactd --doctor`: checks what the configuration needs of this machine (camera nodes and their
/// ports, SPI and GPIO with their permissions, SPI rate, clocks, power, real-time limits, memory)
/// and prints one line for each check; under a failed one, the command that fixes it.
/// Changes nothing: it measures the SPI's true rate with zeros, which LEDs ignore. Returns the exit
/// status: 0 when nothing is wrong, else 1.
[[nodiscard]] int doctor(const hal::Config& config, std::ostream& out,
                         const Machine& machine = Machine());

/// `dtactd --doctor --report`: describes this machine (board, system, libraries, cameras with their
/// modes) with the doctor's findings, for other readers: without user names, host names
/// and serial numbers.
void report(const hal::Config& config, std::ostream& out, const Machine& machine = Machine());

}  // namespace dtact::app
