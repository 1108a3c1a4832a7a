#include "hal/base/side_thread.hpp"

#include <utility>

namespace dtact::base {

SideThread::SideThread(std::string name, std::function<void()> job)
    : name_(std::move(name)), job_(std::move(job)) {}

void SideThread::start() {
  stop_ = false;
  thread_ = RtThread({.name = name_, .cpu = {}}, [this] { run(); });
}

void SideThread::stop() noexcept {
  stop_ = true;
  work_.ring();
  thread_.join();
}

void SideThread::hand_over() noexcept {
  busy_.store(true, std::memory_order_release);
  work_.ring();
}

void SideThread::run() {
  for (;;) {
    work_.wait();
    if (busy()) {
      job_();
      busy_.store(false, std::memory_order_release);
      busy_.notify_all();
    }
    if (stop_) return;
  }
}

}  // namespace dtact::base
