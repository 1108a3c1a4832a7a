#include "hal/base/free_memory.hpp"

#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <fstream>
#include <string>

#include "hal/base/rt_thread.hpp"

namespace dtact::base {
namespace {

/// A field of /proc/self/status, "VmLck" or the like, see proc(5); 0 where there is none.
unsigned long long status_field(const std::string& name, int base) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(name + ":"))
      return std::stoull(line.substr(name.size() + 1), nullptr, base);
  }
  return 0;
}

/// Locking again counts the whole address space against the limit, and could fail.
bool can_lock_again() {
  constexpr unsigned long long kIpcLock = 1ULL << 14U;  // CAP_IPC_LOCK: no limit counts
  rlimit limit{};
  return (status_field("CapEff", 16) & kIpcLock) != 0 ||
         (::getrlimit(RLIMIT_MEMLOCK, &limit) == 0 &&
          (limit.rlim_cur == RLIM_INFINITY || status_field("VmSize", 10) * 1024 < limit.rlim_cur));
}

}  // namespace

void keep_little_memory() {
  constexpr int kLarge = 256 << 10;
  (void)::mallopt(M_ARENA_MAX, 2);
  (void)::mallopt(M_MMAP_THRESHOLD, kLarge);
  (void)::mallopt(M_TRIM_THRESHOLD, 4 << 20);
}

void release_free_memory() {
  const bool locked = status_field("VmLck", 10) > 0;
  if (locked && !can_lock_again()) return;
  if (locked) ::munlockall();
  (void)::malloc_trim(0);
  if (locked) (void)lock_memory();
}

}  // namespace dtact::base
