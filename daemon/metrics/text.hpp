#pragma once

#include <cstdint>
#include <string>

#include "daemon/net/overview.hpp"
#include "hal/base/machine.hpp"

namespace dtact::metrics {

/// Everything in Prometheus' text format 0.0.4, each metric with its help, in base units; counters
/// end with _total. `now_ns`: CLOCK_MONOTONIC.
[[nodiscard]] std::string text(const net::Overview& overview, const base::Heap& heap,
                               std::int64_t now_ns);

}  // namespace dtact::metrics
