#pragma once

#include <iosfwd>

#include "daemon/app/doctor/machine.hpp"
#include "hal/config.hpp"

namespace dtact::app {

/// What a reader elsewhere has to know of this machine to understand the findings, a line each.
/// Nothing personal: of a camera its product name and modes, never its serial number.
void print_facts(const Machine& machine, const hal::Config& config, std::ostream& out);

}  // namespace dtact::app
