#include "tests/unit/libcamera/kernel_double.hpp"

#include <linux/dma-buf.h>
#include <linux/dma-heap.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <mutex>

namespace dtact::libcamera_test {
namespace {

std::mutex mutex;  // libcamera's thread calls, too

int fail(int error) {
  errno = error;
  return -1;
}

int allocate(dma_heap_allocation_data& wanted) {
  const std::lock_guard guard(mutex);
  if (!kernel().has_memory) return fail(ENOMEM);
  const int fd = ::memfd_create("heap", MFD_CLOEXEC);
  if (fd < 0 || ::ftruncate(fd, static_cast<off_t>(wanted.len)) != 0) return -1;
  wanted.fd = static_cast<unsigned>(fd);
  ++kernel().allocated;
  return 0;
}

int sync(const dma_buf_sync& flags) {
  const std::lock_guard guard(mutex);
  kernel().syncs.push_back(static_cast<unsigned>(flags.flags));
  if (kernel().failures.empty()) return 0;
  const int error = kernel().failures.front();
  kernel().failures.pop_front();
  return fail(error);
}

}  // namespace

KernelDouble& kernel() {
  static KernelDouble present;
  return present;
}

KernelDouble& new_kernel() { return kernel() = KernelDouble(); }

}  // namespace dtact::libcamera_test

extern "C" int ioctl(int fd, unsigned long request, ...) noexcept {
  std::va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (request == DMA_HEAP_IOCTL_ALLOC) {
    return dtact::libcamera_test::allocate(*static_cast<dma_heap_allocation_data*>(argument));
  }
  if (request == DMA_BUF_IOCTL_SYNC) {
    return dtact::libcamera_test::sync(*static_cast<const dma_buf_sync*>(argument));
  }
  return static_cast<int>(::syscall(SYS_ioctl, fd, request, argument));
}
