#pragma once

namespace dtact::base {

/// Gives free memory back to the system, also that of a process whose memory is locked
/// (lock_memory()): the kernel takes no pages out of the middle of a locked range, so the lock is
/// released for that moment. Does
/// nothing where the memory could not be locked again. A few milliseconds. One thread at a
/// time: the worker of the daemon.
void release_free_memory();

}  // namespace dtact::base
