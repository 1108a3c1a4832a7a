#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "hal/base/doorbell.hpp"
#include "hal/base/rt_thread.hpp"

namespace dtact::base {

/// One thread with normal scheduling for all that takes too long for the capture thread.
class BackgroundThread {
 public:
  /// A kind of work for the thread, one piece at a time. The caller fills in the work's data
  /// while the job is not busy, and leaves it alone while it is. The thread outlives
  /// its jobs: it gets them before it starts, and ends when the first of them is destroyed.
  class Job {
   public:
    /// `work` must not throw.
    Job(BackgroundThread& thread, std::function<void()> work);
    Job(const Job&) = delete;
    Job& operator=(const Job&) = delete;
    ~Job() { thread_.stop(); }

    /// Neither waits nor allocates. True from hand_over() until the work is done.
    [[nodiscard]] bool busy() const noexcept { return busy_.load(std::memory_order_acquire); }
    /// Has the work done. Neither waits nor allocates; only while not busy.
    void hand_over() noexcept;
    /// Waits while it is busy.
    void settle() const noexcept { busy_.wait(true, std::memory_order_acquire); }

   private:
    friend BackgroundThread;
    BackgroundThread& thread_;
    std::function<void()> work_;
    std::atomic<bool> busy_{false};
  };

  /// `name`: at most 15 characters.
  explicit BackgroundThread(std::string name) : name_(std::move(name)) {}
  BackgroundThread(const BackgroundThread&) = delete;
  BackgroundThread& operator=(const BackgroundThread&) = delete;
  ~BackgroundThread() { stop(); }

  void start();
  /// Ends the thread after the work already started.
  void stop() noexcept;

 private:
  void run();

  std::string name_;
  std::vector<Job*> jobs_;
  std::atomic<bool> stop_{false};
  Doorbell work_;
  RtThread thread_;
};

}  // namespace dtact::base
