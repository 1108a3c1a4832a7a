#pragma once

#include <deque>
#include <vector>

namespace dtact::libcamera_test {

/// A double of the kernel's DMA heaps and buffers: this program's ioctl() answers their two calls
/// (linux/dma-heap.h, linux/dma-buf.h), with memory files for buffers.
struct KernelDouble {
  bool has_memory = true;       ///< DMA_HEAP_IOCTL_ALLOC gives buffers; else fails with ENOMEM.
  std::deque<int> failures;     ///< errno of the next DMA_BUF_IOCTL_SYNCs; then they succeed.
  std::vector<unsigned> syncs;  ///< Flags of the DMA_BUF_IOCTL_SYNCs that were made.
  unsigned allocated = 0;       ///< Buffers allocated so far.
};

/// The double in use; new_kernel() replaces it.
KernelDouble& kernel();
KernelDouble& new_kernel();

}  // namespace dtact::libcamera_test
