#include "hal/base/clock.hpp"

#include <cerrno>
#include <ctime>

namespace dtact::base {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::int64_t read_clock(clockid_t id) noexcept {
  timespec t{};
  ::clock_gettime(id, &t);
  return t.tv_sec * kSecond + t.tv_nsec;
}

class SystemClock final : public Clock {
 public:
  [[nodiscard]] std::int64_t monotonic_ns() const noexcept override {
    return read_clock(CLOCK_MONOTONIC);
  }
  [[nodiscard]] std::int64_t wall_ns() const noexcept override {
    return read_clock(CLOCK_REALTIME);
  }
  void sleep_until(std::int64_t deadline_ns) noexcept override {
    const timespec deadline{.tv_sec = deadline_ns / kSecond, .tv_nsec = deadline_ns % kSecond};
    while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
    }
  }
};

}  // namespace

Clock& system_clock() noexcept {
  static SystemClock clock;
  return clock;
}

}  // namespace dtact::base
