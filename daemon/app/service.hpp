#pragma once

#include <string>

namespace dtact::app {

/// What systemd is told (sd_notify(3)). Every call is a no-op when no service manager listens.
void notify_ready(const std::string& status);
void notify_status(const std::string& status);
void notify_stopping();

/// Half of the unit's WatchdogSec= in microseconds, the interval at which to call notify_alive();
/// 0 when no watchdog is set.
[[nodiscard]] unsigned long long watchdog_interval_us();
void notify_alive();

/// The unit's state folder ($STATE_DIRECTORY), or empty.
[[nodiscard]] std::string state_directory();
/// The unit's folder below /run ($RUNTIME_DIRECTORY), or empty.
[[nodiscard]] std::string runtime_directory();

}  // namespace dtact::app
