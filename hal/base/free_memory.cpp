#include "hal/base/free_memory.hpp"

#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <fstream>
#include <string>

#include "hal/base/rt_thread.hpp"

namespace dtact::base {
namespace {

/// "VmLck:   1234 kB" of /proc/self/status, see proc(5).
bool is_memory_locked() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmLck:")) return line.find_first_of("123456789") != std::string::npos;
  }
  return false;
}

/// Locking again counts the whole address space against a finite limit, and could fail.
bool can_lock_again() {
  rlimit limit{};
  return ::getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY;
}

}  // namespace

void release_free_memory() {
  const bool locked = is_memory_locked();
  if (locked && !can_lock_again()) return;
  if (locked) ::munlockall();
  (void)::malloc_trim(0);
  if (locked) (void)lock_memory();
}

}  // namespace dtact::base
