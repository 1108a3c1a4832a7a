// loop_jitter CPU PRIORITY SECONDS: delay with which this machine wakes a FIFO thread that only
// sleeps, a millisecond at a time, in microseconds: a lower bound for every program on it.
#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/base/rt_thread.hpp"

int main(int argc, char** argv) {
  if (argc != 4) {
    fmt::print(stderr, "usage: loop_jitter CPU PRIORITY SECONDS\n");
    return 2;
  }
  try {
    constexpr std::int64_t kStep = 1'000'000;
    std::vector<std::int64_t> late(std::stoul(argv[3]) * 1000);
    dtact::base::RtThread thread(
        {.name = "loop-jitter", .cpu = std::stoi(argv[1]), .fifo_priority = std::stoi(argv[2])},
        [&] {
          auto& clock = dtact::base::system_clock();
          std::int64_t due = clock.monotonic_ns();
          for (std::int64_t& ns : late) {
            clock.sleep_until(due += kStep);
            ns = clock.monotonic_ns() - due;
          }
        });
    thread.join();
    std::ranges::sort(late);
    const auto at = [&](double share) {
      return late[static_cast<std::size_t>(share * static_cast<double>(late.size() - 1))] / 1000;
    };
    fmt::print("p50 {} us, p99 {}, p99.9 {}, max {}\n", at(0.5), at(0.99), at(0.999), at(1));
    for (const std::string& refused : thread.refused()) fmt::print("refused: {}\n", refused);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "loop_jitter: {}\n", e.what());
    return 1;
  }
}
