#pragma once

#include <deque>
#include <vector>

namespace dtact::libcamera_test {

/// What stands in for the kernel's DMA heaps and buffers: this program's ioctl() answers the two
/// calls that they know (linux/dma-heap.h, linux/dma-buf.h), with memory files for buffers.
struct KernelDouble {
  bool has_memory = true;       ///< DMA_HEAP_IOCTL_ALLOC gives buffers; else fails with ENOMEM.
  std::deque<int> failures;     ///< errno of the next DMA_BUF_IOCTL_SYNCs; then they succeed.
  std::vector<unsigned> syncs;  ///< The flags of those that were made.
  unsigned allocated = 0;       ///< Buffers given.
};

/// The one in force; a new one begins.
KernelDouble& kernel();
KernelDouble& new_kernel();

}  // namespace dtact::libcamera_test
