#include "hal/base/background_thread.hpp"

namespace dtact::base {

BackgroundThread::Job::Job(BackgroundThread& thread, std::function<void()> work)
    : thread_(thread), work_(std::move(work)) {
  thread_.jobs_.push_back(this);
}

void BackgroundThread::Job::hand_over() noexcept {
  busy_.store(true, std::memory_order_release);
  thread_.work_.ring();
}

void BackgroundThread::start() {
  stop_ = false;
  thread_ = RtThread({.name = name_, .cpu = {}}, [this] { run(); });
}

void BackgroundThread::stop() noexcept {
  stop_ = true;
  work_.ring();
  thread_.join();
}

void BackgroundThread::run() {
  for (;;) {
    work_.wait();
    const bool last = stop_;  // jobs started before stop() are seen below
    for (Job* job : jobs_) {
      if (!job->busy()) continue;
      job->work_();
      job->busy_.store(false, std::memory_order_release);
      job->busy_.notify_all();
    }
    if (last) return;
  }
}

}  // namespace dtact::base
