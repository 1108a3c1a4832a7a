#include "daemon/app/service.hpp"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>

#include "daemon/app/config.hpp"

namespace dtact::app {

void notify_ready(const std::string& status) {
  sd_notify(0, ("READY=1\nSTATUS=" + status).c_str());
}
void notify_status(const std::string& status) { sd_notify(0, ("STATUS=" + status).c_str()); }
void notify_stopping() { sd_notify(0, "STOPPING=1"); }

void notify_reloading() {
  using std::chrono::duration_cast;
  using std::chrono::microseconds;
  // CLOCK_MONOTONIC on Linux.
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  sd_notify(0,
            fmt::format("RELOADING=1\nMONOTONIC_USEC={}", duration_cast<microseconds>(now).count())
                .c_str());
}

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

std::filesystem::path resolve_credential(const std::string& key,
                                         const std::filesystem::path& path) {
  const std::string text = path.string();
  if (!text.starts_with(kCredential)) return path;
  const std::string name = text.substr(kCredential.size());
  const std::string folder = folder_in("CREDENTIALS_DIRECTORY");
  const std::filesystem::path file = std::filesystem::path(folder) / name;
  if (!folder.empty() && ::access(file.c_str(), F_OK) == 0) return file;
  throw std::runtime_error(fmt::format(
      "{} = \"{}\": systemd handed in no credential of that name: put it into "
      "/etc/credstore/dtactd.{} (of dtactd@NAME into dtactd@NAME.{}) and restart the unit, or name "
      "a file",
      key, text, name, name));
}

bool under_systemd() { return std::getenv("INVOCATION_ID") != nullptr; }
std::string state_directory() { return folder_in("STATE_DIRECTORY"); }
std::string runtime_directory() { return folder_in("RUNTIME_DIRECTORY"); }

}  // namespace dtact::app
