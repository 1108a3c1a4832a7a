#include "tests/accuracy/chart/instructions.hpp"

#include <linux/perf_event.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "hal/base/unique_fd.hpp"

namespace dtact::chart {

std::optional<std::uint64_t> count_instructions(const std::function<void()>& work) {
  perf_event_attr attributes{};
  attributes.type = PERF_TYPE_HARDWARE;
  attributes.size = sizeof attributes;
  attributes.config = PERF_COUNT_HW_INSTRUCTIONS;
  attributes.disabled = 1;
  attributes.exclude_kernel = 1;
  attributes.exclude_hv = 1;
  // The C library has no wrapper for this call.
  const base::UniqueFd counter(
      static_cast<int>(::syscall(SYS_perf_event_open, &attributes, 0, -1, -1, 0)));
  if (!counter) return std::nullopt;
  ::ioctl(counter.get(), PERF_EVENT_IOC_ENABLE, 0);
  work();
  ::ioctl(counter.get(), PERF_EVENT_IOC_DISABLE, 0);
  std::uint64_t count = 0;
  if (::read(counter.get(), &count, sizeof count) != sizeof count) return std::nullopt;
  return count;
}

}  // namespace dtact::chart
