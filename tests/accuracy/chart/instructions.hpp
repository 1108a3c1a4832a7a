#pragma once

#include <cstdint>
#include <functional>
#include <optional>

namespace dtact::chart {

/// User-space instructions that `work` takes on this thread, counted by the processor; nothing
/// where the system does not allow it (/proc/sys/kernel/perf_event_paranoid above 2, or no
/// counter).
[[nodiscard]] std::optional<std::uint64_t> count_instructions(const std::function<void()>& work);

}  // namespace dtact::chart
