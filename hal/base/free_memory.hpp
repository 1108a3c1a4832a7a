#pragma once

namespace dtact::base {

/// From now on, memory of large messages and of frames returns to the system after use, even from
/// the middle of the heap. Without this glibc keeps up to twice the largest block ever used
/// (mallopt(3), dynamic mmap threshold), locked into memory with the rest. Free memory in one
/// thread's arena is of no use to another thread. Two arenas are enough: the capture thread, which
/// must not wait for another's lock, allocates nothing. A block of 256 KiB or more costs page
/// faults each time it is allocated: the daemon reuses the buffers of its frames. Called before any
/// thread starts.
void keep_little_memory();

/// Gives free memory back to the system, also that of a process whose memory is locked
/// (lock_memory()): the kernel takes no pages out of the middle of a locked range, so the lock is
/// released for that moment. Does
/// nothing where the memory could not be locked again. A few milliseconds. One thread at a
/// time: the worker of the daemon.
void release_free_memory();

}  // namespace dtact::base
