#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "hal/base/doorbell.hpp"
#include "hal/base/rt_thread.hpp"

namespace dtact::base {

/// A thread with normal scheduling for what takes too long for the capture thread, one job at a
/// time: whoever hands over fills in the job's data while the thread is not busy, and leaves it
/// alone until it is not again.
class SideThread {
 public:
  /// `name`: at most 15 characters. `job` must not throw.
  SideThread(std::string name, std::function<void()> job);
  SideThread(const SideThread&) = delete;
  SideThread& operator=(const SideThread&) = delete;
  ~SideThread() { stop(); }

  void start();
  /// Ends the thread after the job that was handed over.
  void stop() noexcept;

  /// Neither waits nor allocates. True from hand_over() until the job is done.
  [[nodiscard]] bool busy() const noexcept { return busy_.load(std::memory_order_acquire); }
  /// Has the job done. Neither waits nor allocates; only while not busy.
  void hand_over() noexcept;
  /// Waits while it is busy.
  void settle() const noexcept { busy_.wait(true, std::memory_order_acquire); }

 private:
  void run();

  std::string name_;
  std::function<void()> job_;
  std::atomic<bool> busy_{false};
  std::atomic<bool> stop_{false};
  Doorbell work_;
  RtThread thread_;
};

}  // namespace dtact::base
