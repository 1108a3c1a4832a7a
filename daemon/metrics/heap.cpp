#include "daemon/metrics/heap.hpp"

#include <malloc.h>

namespace dtact::metrics {

Heap heap() noexcept {
  const auto info = ::mallinfo2();
  return {.used = info.uordblks + info.hblkhd, .free = info.fordblks, .mapped = info.hblkhd};
}

}  // namespace dtact::metrics
