#pragma once

#include <filesystem>
#include <string>

namespace dtact::app {

/// Notifications to systemd (sd_notify(3)). Every call is a no-op without a service manager.
/// None waits longer than five seconds for a manager that does not read. Repeated notifications
/// (status and sign of life) do not wait at all.
void notify_ready(const std::string& status);
/// False when it could not be sent now.
bool notify_status(const std::string& status);
void notify_stopping();
/// The configuration is being read again; notify_ready() ends it. Type=notify-reload (systemd 253)
/// waits for both, Type=notify shows them.
void notify_reloading();

/// An eighth of the unit's WatchdogSec= in microseconds, the interval at which to call
/// notify_alive(); 0 when no watchdog is set.
[[nodiscard]] unsigned long long watchdog_interval_us();
void notify_alive();

/// Whether a unit of systemd's started this program ($INVOCATION_ID).
[[nodiscard]] bool under_systemd();
/// The name of a sensor that has none of its own: the unit's ($DTACTD_NAME), else the machine's.
[[nodiscard]] std::string default_name();
/// The unit's state folder ($STATE_DIRECTORY), or empty.
[[nodiscard]] std::string state_directory();
/// The file that "credential:NAME" stands for, one that systemd handed in (LoadCredential= of the
/// unit); any other path stays as it is. Throws std::runtime_error, with `key` and the fix, when
/// there is none of that name.
[[nodiscard]] std::filesystem::path resolve_credential(const std::string& key,
                                                       const std::filesystem::path& path);
/// Whether this process may look into the unit's credentials ($CREDENTIALS_DIRECTORY): not where
/// there is no unit, nor, with systemd 252, in a command of ExecReload=.
[[nodiscard]] bool has_credentials();
/// The unit's folder below /run ($RUNTIME_DIRECTORY), or empty.
[[nodiscard]] std::string runtime_directory();

}  // namespace dtact::app
