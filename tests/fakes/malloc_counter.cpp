#include "tests/fakes/malloc_counter.hpp"

#include <atomic>
#include <cerrno>
#include <cstddef>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define DTACT_OWN_MALLOC 0
#else
#define DTACT_OWN_MALLOC 1
#endif

namespace {

std::atomic<std::uint64_t> counted{0};
thread_local bool counting = false;

#if DTACT_OWN_MALLOC
void note() noexcept {
  if (counting) counted.fetch_add(1, std::memory_order_relaxed);
}
#endif

}  // namespace

#if DTACT_OWN_MALLOC
// glibc's own functions, under the names that it offers to replacements of malloc.
// NOLINTBEGIN(bugprone-reserved-identifier)
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);
// NOLINTEND(bugprone-reserved-identifier)

void* malloc(std::size_t size) {
  note();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  note();
  return __libc_calloc(count, size);
}
void* realloc(void* old, std::size_t size) {
  note();
  return __libc_realloc(old, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
void free(void* old) {
  if (old != nullptr) note();
  __libc_free(old);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  note();
  void* const made = __libc_memalign(alignment, size);
  if (made == nullptr) return ENOMEM;
  *out = made;
  return 0;
}
}
#endif

namespace dtact::fakes {

bool can_count_allocations() noexcept { return DTACT_OWN_MALLOC != 0; }
void count_allocations(bool on) noexcept { counting = on; }
std::uint64_t counted_allocations() noexcept { return counted.load(); }

}  // namespace dtact::fakes
