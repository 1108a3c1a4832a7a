#include "daemon/app/health_log.hpp"

#include <fmt/format.h>

#include <utility>

#include "daemon/net/advice.hpp"

namespace dtact::app {
namespace {

using pipeline::Health;

/// Part of every start and of every change of the light.
bool is_usual(Health health) {
  return health == Health::starting || health == Health::light_unsettled;
}

}  // namespace

HealthLog::HealthLog(pipeline::HealthSet reported) {
  for (int i = 0; i < pipeline::kHealthCount; ++i) {
    health_flags_.at(static_cast<std::size_t>(i)).known = reported.has(static_cast<Health>(i));
  }
}

std::vector<HealthLog::Line> HealthLog::step(const pipeline::Status& status, Time now) {
  std::vector<Line> lines;
  if (began_ == Time::min()) began_ = now;
  for (int i = 0; i < pipeline::kHealthCount; ++i) {
    const auto health = static_cast<Health>(i);
    Flag& flag = health_flags_.at(static_cast<std::size_t>(i));
    const bool on = status.health.has(health);
    // What was wrong at the start, and was right before the first look.
    if (!on && now - began_ > kPause) flag.known = false;
    if (on && !flag.on) {
      if (std::exchange(flag.known, false)) {
        flag.reported = true;
      } else {
        ++flag.times;
      }
    }
    flag.on = on;
    const std::string name = net::health_name(health);
    if (!on && flag.reported) {
      lines.push_back({false, name, fmt::format("{} is over", name)});
      flag.reported = false;
    }
    const bool paused = flag.last != Time::min() && now - flag.last < kPause;
    if (flag.times == 0 || paused) continue;
    const unsigned times = std::exchange(flag.times, 0);
    flag.last = now;
    flag.reported = on;
    const std::string often = times > 1 || !on
                                  ? fmt::format(" (came {} time{} since it was last reported)",
                                                times, times == 1 ? "" : "s")
                                  : "";
    lines.push_back(
        {!is_usual(health), name, fmt::format("{}: {}{}", name, net::fix(status, health), often)});
  }
  return lines;
}

}  // namespace dtact::app
