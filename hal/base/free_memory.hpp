#pragma once

namespace dtact::base {

/// Gives free memory back to the system, also that of a process whose memory is locked
/// (lock_memory()): the kernel takes no pages out of the middle of a locked range, so the lock is
/// released for that moment. A few milliseconds; any thread, but not two at once.
void release_free_memory();

}  // namespace dtact::base
