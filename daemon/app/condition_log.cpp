#include "daemon/app/condition_log.hpp"

#include <fmt/format.h>

#include <utility>

#include "daemon/net/advice.hpp"

namespace dtact::app {
namespace {

using pipeline::Health;

/// What to do about this condition alone.
std::string remedy(const pipeline::Status& status, Health health) {
  pipeline::Status only = status;
  only.state = pipeline::State::serving;
  only.health = {};
  only.health.set(health);
  only.storage_message.clear();
  return net::advice(only);
}

/// Part of every start and of every change of the light.
bool is_usual(Health health) {
  return health == Health::starting || health == Health::light_unsettled;
}

}  // namespace

ConditionLog::ConditionLog(pipeline::HealthSet told) {
  for (int i = 0; i < pipeline::kHealthCount; ++i) {
    conditions_.at(static_cast<std::size_t>(i)).known = told.has(static_cast<Health>(i));
  }
}

std::vector<ConditionLog::Line> ConditionLog::step(const pipeline::Status& status, Time now) {
  std::vector<Line> lines;
  for (int i = 0; i < pipeline::kHealthCount; ++i) {
    const auto health = static_cast<Health>(i);
    Condition& condition = conditions_.at(static_cast<std::size_t>(i));
    const bool on = status.health.has(health);
    if (on && !condition.on) {
      if (std::exchange(condition.known, false)) {
        condition.told = true;
      } else {
        ++condition.times;
      }
    }
    condition.on = on;
    const std::string name = net::health_name(health);
    if (!on && condition.told) {
      lines.push_back({false, name, fmt::format("{} is over", name)});
      condition.told = false;
    }
    const bool paused = condition.last != Time::min() && now - condition.last < kPause;
    if (condition.times == 0 || paused) continue;
    const unsigned times = std::exchange(condition.times, 0);
    condition.last = now;
    condition.told = on;
    const std::string often =
        times > 1 || !on
            ? fmt::format(" (came {} time{} since it was last told)", times, times == 1 ? "" : "s")
            : "";
    lines.push_back(
        {!is_usual(health), name, fmt::format("{}: {}{}", name, remedy(status, health), often)});
  }
  return lines;
}

}  // namespace dtact::app
