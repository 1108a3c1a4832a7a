#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <sstream>
#include <string_view>

#include "daemon/app/doctor/checks.hpp"

namespace dtact::app {

Findings check_realtime(const Machine& machine) {
  if (machine.privileged()) {
    return {{Verdict::good,
             machine.has_service() ? "dtactd.service sets its own limits" : "root has no limits",
             ""}};
  }
  // The service's limits are its unit's; this user's count for a daemon that the user starts.
  const Verdict bad = machine.has_service() ? Verdict::note : Verdict::wrong;
  const std::string limits = "/etc/security/limits.d/dtactd.conf";
  const auto fix = [&](const char* what) {
    return fmt::format(
        "echo '{} - {}' | sudo tee -a {}, then log in again (under systemd the unit's "
        "LimitRTPRIO= and LimitMEMLOCK= do this)",
        machine.user(), what, limits);
  };
  Findings findings;
  const rlim_t priority = machine.limit(RLIMIT_RTPRIO);
  if (priority == 0) {
    findings.push_back({bad, "RLIMIT_RTPRIO = 0: no real-time scheduling", fix("rtprio 90")});
  } else {
    findings.push_back({Verdict::good,
                        priority == RLIM_INFINITY ? "RLIMIT_RTPRIO is unlimited"
                                                  : fmt::format("RLIMIT_RTPRIO = {}", priority),
                        ""});
  }
  const rlim_t memory = machine.limit(RLIMIT_MEMLOCK);
  // mlockall() counts the whole address space, used or not: some hundreds of megabytes.
  constexpr rlim_t kEnough = 1U << 30U;
  if (memory < kEnough) {
    findings.push_back(
        {bad, fmt::format("RLIMIT_MEMLOCK = {} kB: memory cannot be locked", memory / 1024),
         fix("memlock unlimited")});
  } else {
    findings.push_back({Verdict::good, "RLIMIT_MEMLOCK suffices", ""});
  }
  return findings;
}

Findings check_realtime_share(const Machine& machine) {
  const auto runtime = machine.line("/proc/sys/kernel/sched_rt_runtime_us");
  const auto period = machine.line("/proc/sys/kernel/sched_rt_period_us");
  if (!runtime || !period) return {};
  const long runtime_us = std::strtol(runtime->c_str(), nullptr, 10);
  const long period_us = std::strtol(period->c_str(), nullptr, 10);
  const std::string what = fmt::format("sched_rt_runtime_us = {} of {}", runtime_us, period_us);
  // -1 is without a limit; 95 % is the kernel's default (Documentation/scheduler/sched-rt-group).
  if (runtime_us < 0 || 10 * runtime_us >= 9 * period_us) return {{Verdict::good, what, ""}};
  return {{runtime_us == 0 ? Verdict::wrong : Verdict::note,
           what + ": real-time threads stand still for the rest",
           "sudo sysctl kernel.sched_rt_period_us=1000000 kernel.sched_rt_runtime_us=950000"}};
}

Findings check_memory(const Machine& machine) {
  std::istringstream info(machine.text("/proc/meminfo"));
  std::string key;
  long available_kb = -1;
  for (std::string line; std::getline(info, line);) {
    std::istringstream words(line);
    if (words >> key && key == "MemAvailable:") words >> available_kb;
  }
  if (available_kb < 0) return {};
  const std::string what = fmt::format("{} MiB are available", available_kb / 1024);
  // Twice what it holds with eight clients (tests/MEASURED.md).
  constexpr long kEnoughKb = 128L * 1024;
  if (available_kb >= kEnoughKb) return {{Verdict::good, what, ""}};
  return {{Verdict::note, what + ": too few for a daemon that locks its memory",
           "ps -eo rss,comm --sort=-rss | head"}};
}

Findings check_clock_source(const Machine& machine) {
  const std::string folder = "/sys/devices/system/clocksource/clocksource0/";
  const auto current = machine.line(folder + "current_clocksource");
  if (!current) return {{Verdict::note, "the clock source cannot be read", "ls " + folder}};
  // Those that the kernel's vDSO reads without a system call; the others cost a microsecond each.
  constexpr std::array<std::string_view, 5> kQuick{
      "tsc", "kvm-clock", "hyperv_clocksource_tsc_page", "arch_sys_counter", "riscv_clocksource"};
  if (std::find(kQuick.begin(), kQuick.end(), *current) != kQuick.end()) {
    return {{Verdict::good, *current, ""}};
  }
  std::istringstream available(machine.line(folder + "available_clocksource").value_or(""));
  for (std::string name; available >> name;) {
    if (std::find(kQuick.begin(), kQuick.end(), name) != kQuick.end()) {
      return {{Verdict::wrong, fmt::format("{}: each reading is a slow call", *current),
               fmt::format("echo {} | sudo tee {}current_clocksource", name, folder)}};
    }
  }
  return {{Verdict::note,
           fmt::format("{}: each reading is a slow call, and there is no other", *current),
           "see dmesg | grep -i clocksource for why the quick one was given up"}};
}

Findings check_governor(const Machine& machine) {
  const std::string cpus = "/sys/devices/system/cpu";
  std::string slow;
  int governed = 0;
  for (const std::string& cpu : machine.list(cpus, "cpu")) {
    const auto governor = machine.line(cpu + "/cpufreq/scaling_governor");
    if (!governor) continue;
    ++governed;
    if (*governor != "performance") slow = *governor;
  }
  if (governed == 0) return {{Verdict::good, "the processor's clock is not governed here", ""}};
  if (slow.empty()) return {{Verdict::good, "performance", ""}};
  return {{Verdict::note, fmt::format("{}: the clock climbs only after a frame is late", slow),
           fmt::format("echo performance | sudo tee {}/cpu*/cpufreq/scaling_governor", cpus)}};
}

}  // namespace dtact::app
