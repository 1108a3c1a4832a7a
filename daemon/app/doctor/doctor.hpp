#pragma once

#include <iosfwd>

#include "daemon/app/doctor/machine.hpp"
#include "hal/config.hpp"

namespace dtact::app {

/// `dtactd --doctor`: looks at what the configuration needs of this machine (camera nodes and their
/// ports, SPI and GPIO with their permissions, SPI rate, clocks, power, real-time limits, memory)
/// and prints one line for each thing looked at; under what is wrong, the command that fixes it.
/// Changes nothing: the SPI's true rate is measured with zeros, which LEDs ignore. Returns the exit
/// status: 0 when nothing is wrong, else 1.
[[nodiscard]] int doctor(const hal::Config& config, std::ostream& out,
                         const Machine& machine = Machine());

/// `dtactd --doctor --report`: what this machine is (board, system, libraries, cameras with their
/// modes) and the doctor's findings, for somebody else to read: neither names of users and hosts
/// nor serial numbers stand in it.
void report(const hal::Config& config, std::ostream& out, const Machine& machine = Machine());

}  // namespace dtact::app
