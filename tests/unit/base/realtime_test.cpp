// What a real-time thread does that has more work than time.
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "hal/base/realtime_throttle.hpp"
#include "hal/base/rt_thread.hpp"
#include "tests/fakes/fake_clock.hpp"

namespace dtact::base {
namespace {

using namespace std::chrono_literals;
constexpr std::int64_t kMs = 1'000'000;

/// Lets the thread wait as the kernel counts it: on a busy machine a short sleep can be over before
/// it has begun.
void wait_once() {
  const auto waits = [] {
    rusage usage{};
    ::getrusage(RUSAGE_THREAD, &usage);
    return usage.ru_nvcsw;
  };
  const long before = waits();
  while (waits() == before) {
    const timespec pause{.tv_sec = 0, .tv_nsec = 1000};
    ::nanosleep(&pause, nullptr);
  }
}

TEST(RealtimeThrottle, SleepsWhenTheThreadHasNotWaited) {
  fakes::FakeClock clock;
  RealtimeThrottle throttle(clock, 7ms);
  clock.now += 100 * kMs;
  throttle.pause_if_busy();
  const std::int64_t began_ns = clock.now;
  for (int i = 0; i < 99; ++i) {
    clock.now += kMs;
    throttle.pause_if_busy();
  }
  EXPECT_EQ(clock.now, began_ns + 99 * kMs) << "too soon";
  clock.now += kMs;
  throttle.pause_if_busy();
  EXPECT_EQ(clock.now, began_ns + 107 * kMs);
}

TEST(RealtimeThrottle, LeavesAThreadAloneThatWaits) {
  fakes::FakeClock clock;
  RealtimeThrottle throttle(clock, 7ms);
  throttle.pause_if_busy();
  const std::int64_t began_ns = clock.now;
  for (int i = 0; i < 20; ++i) {
    wait_once();
    clock.now += 100 * kMs;
    throttle.pause_if_busy();
  }
  EXPECT_EQ(clock.now, began_ns + 2000 * kMs);
}

std::int64_t thread_cpu_ms() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return used.tv_sec * 1000 + used.tv_nsec / 1'000'000;
}

/// In a process of its own: a real-time thread twice runs for 0.5 s without waiting. 0: it was
/// demoted in time.
int run_away() {
  const rlimit limit{.rlim_cur = 200'000, .rlim_max = 400'000};
  ::setrlimit(RLIMIT_RTTIME, &limit);
  demote_at_rttime_limit();
  if (make_fifo("runaway", 1)) return 77;
  // The next one is warned as well.
  for (int i = 0; i < 2; ++i) {
    const std::int64_t end_ms = thread_cpu_ms() + 500;
    while (thread_cpu_ms() < end_ms) {
    }
    if (!was_demoted() || (::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK) != SCHED_OTHER) return 1;
    if (i == 0 && make_fifo("runaway", 1)) return 77;
  }
  return 0;
}

TEST(DemoteAtRttimeLimit, KeepsTheProcessAlive) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(run_away());
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status)) << "ended by signal " << WTERMSIG(status);
  if (WEXITSTATUS(status) == 77) GTEST_SKIP() << "no real-time scheduling here";
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace dtact::base
