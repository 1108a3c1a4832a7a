#include "daemon/app/service.hpp"

#include <systemd/sd-daemon.h>

#include <cstdint>
#include <cstdlib>

namespace dtact::app {

void notify_ready(const std::string& status) {
  sd_notify(0, ("READY=1\nSTATUS=" + status).c_str());
}
void notify_status(const std::string& status) { sd_notify(0, ("STATUS=" + status).c_str()); }
void notify_stopping() { sd_notify(0, "STOPPING=1"); }

unsigned long long watchdog_interval_us() {
  std::uint64_t interval = 0;
  return sd_watchdog_enabled(0, &interval) > 0 ? interval / 2 : 0;
}
void notify_alive() { sd_notify(0, "WATCHDOG=1"); }

namespace {

std::string folder_in(const char* variable) {
  const char* folder = std::getenv(variable);
  return folder == nullptr ? std::string() : std::string(folder);
}

}  // namespace

std::string state_directory() { return folder_in("STATE_DIRECTORY"); }
std::string runtime_directory() { return folder_in("RUNTIME_DIRECTORY"); }

}  // namespace dtact::app
