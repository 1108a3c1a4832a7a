#include "hal/base/side_thread.hpp"

namespace dtact::base {

SideThread::Job::Job(SideThread& thread, std::function<void()> work)
    : thread_(thread), work_(std::move(work)) {
  thread_.jobs_.push_back(this);
}

void SideThread::Job::hand_over() noexcept {
  busy_.store(true, std::memory_order_release);
  thread_.work_.ring();
}

void SideThread::start() {
  stop_ = false;
  thread_ = RtThread({.name = name_, .cpu = {}}, [this] { run(); });
}

void SideThread::stop() noexcept {
  stop_ = true;
  work_.ring();
  thread_.join();
}

void SideThread::run() {
  for (;;) {
    work_.wait();
    const bool last = stop_;  // what was handed over before stop() is seen below
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
