#pragma once

#include <sched.h>

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace dtact::base {

struct RtSettings {
  std::string name;        ///< At most 15 characters (the kernel's limit).
  std::optional<int> cpu;  ///< Pin to this CPU; empty = not pinned.
  int fifo_priority = 0;   ///< SCHED_FIFO 1…99; 0 = normal scheduling.
  std::size_t stack_bytes =
      std::size_t{256} * 1024;  ///< Small, since locked memory counts it whole.
};

/// A thread with a name, a CPU and a scheduling class. What the system refuses is collected and
/// the thread runs all the same. Joins on destruction; the body must watch its own stop flag.
class RtThread {
 public:
  RtThread() = default;
  /// Starts `body`. Throws std::system_error when no thread can be made at all.
  RtThread(const RtSettings& settings, std::function<void()> body);
  RtThread(RtThread&& other) noexcept;
  RtThread& operator=(RtThread&& other) noexcept;
  RtThread(const RtThread&) = delete;
  RtThread& operator=(const RtThread&) = delete;
  ~RtThread() { join(); }

  void join() noexcept;
  /// The CPU that the thread is pinned to.
  [[nodiscard]] std::optional<int> cpu() const noexcept { return cpu_; }
  /// One sentence for each setting the system refused, with the fix.
  [[nodiscard]] const std::vector<std::string>& refused() const noexcept { return refused_; }

 private:
  pthread_t thread_{};
  bool joinable_ = false;
  std::optional<int> cpu_;
  std::vector<std::string> refused_;
};

/// Runs `body` on a thread with normal scheduling that may use all of `cpus`, and waits for its
/// end. Threads that a library starts within inherit neither the caller's priority nor the CPU that
/// it is pinned to. Throws what `body` throws, or std::system_error when no thread can be made.
void run_unpinned(const cpu_set_t& cpus, const std::function<void()>& body);

/// The CPUs that the calling thread may use.
[[nodiscard]] cpu_set_t allowed_cpus() noexcept;

/// Gives the calling thread SCHED_FIFO `priority`, 1 … 99; threads it starts from then on begin
/// with normal scheduling. Returns the sentence that says why it was refused and what to do, or
/// nothing. `name` is how that sentence calls the thread.
[[nodiscard]] std::optional<std::string> make_fifo(const std::string& name, int priority);

/// From now on a real-time thread that has run for the soft limit of RLIMIT_RTTIME without waiting
/// goes on with normal scheduling; without this call the kernel ends the process. The unit's
/// LimitRTTIME= has to have a soft limit below its hard one.
void demote_at_rttime_limit() noexcept;
/// That has happened to the calling thread.
[[nodiscard]] bool was_demoted() noexcept;
/// The sentence that reports it of the thread that is called `name`, with the fix.
[[nodiscard]] std::string demoted_sentence(const std::string& name);

/// Locks the process's memory page by page at first access (MCL_CURRENT | MCL_FUTURE |
/// MCL_ONFAULT). Returns the reason for a failure with its fix, or nothing.
[[nodiscard]] std::optional<std::string> lock_memory();

}  // namespace dtact::base
