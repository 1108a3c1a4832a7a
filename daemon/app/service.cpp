#include "daemon/app/service.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "daemon/app/config.hpp"
#include "hal/base/unique_fd.hpp"

namespace dtact::app {

namespace {

/// What the manager waits for may wait for it: systemd that is busy reads on within moments.
constexpr int kTimeoutMs = 5000;

/// sd_notify(3)'s datagram (its notes state the protocol). sd_notify() itself waits without end for
/// a manager that does not read, and the network with it. False: not sent within `timeout_ms`.
bool notify(const std::string& message, int timeout_ms) {
  const char* name = std::getenv("NOTIFY_SOCKET");
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::size_t length = name == nullptr ? 0 : std::strlen(name);
  if (length < 2 || length >= sizeof address.sun_path) return true;
  std::memcpy(static_cast<char*>(address.sun_path), name, length);
  // An abstract name: its first byte is zero, and its length counts.
  if (name[0] == '@') address.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
  const base::UniqueFd socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket || ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0) {
    return true;
  }
  pollfd writable{socket.get(), POLLOUT, 0};
  if (timeout_ms > 0) (void)::poll(&writable, 1, timeout_ms);
  return ::send(socket.get(), message.data(), message.size(), MSG_NOSIGNAL) >= 0 || errno != EAGAIN;
}

}  // namespace

void notify_ready(const std::string& status) {
  (void)notify("READY=1\nSTATUS=" + status, kTimeoutMs);
}
bool notify_status(const std::string& status) { return notify("STATUS=" + status, 0); }
void notify_stopping() { (void)notify("STOPPING=1", kTimeoutMs); }

void notify_reloading() {
  using std::chrono::duration_cast;
  using std::chrono::microseconds;
  // CLOCK_MONOTONIC on Linux.
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  (void)notify(
      fmt::format("RELOADING=1\nMONOTONIC_USEC={}", duration_cast<microseconds>(now).count()),
      kTimeoutMs);
}

unsigned long long watchdog_interval_us() {
  constexpr std::uint64_t kLooks = 8;  // a thread may be blocked for 7 of 8 parts of the time
  std::uint64_t limit = 0;
  return sd_watchdog_enabled(0, &limit) > 0 ? limit / kLooks : 0;
}
void notify_alive() { (void)notify("WATCHDOG=1", 0); }

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

bool has_credentials() {
  const std::string folder = folder_in("CREDENTIALS_DIRECTORY");
  return !folder.empty() && ::access(folder.c_str(), X_OK) == 0;
}

bool under_systemd() { return std::getenv("INVOCATION_ID") != nullptr; }
std::string default_name() {
  if (const char* name = std::getenv("DTACTD_NAME"); name != nullptr && *name != '\0') return name;
  std::array<char, HOST_NAME_MAX + 1> host{};
  return ::gethostname(host.data(), host.size()) == 0 ? host.data() : "";
}

std::string state_directory() { return folder_in("STATE_DIRECTORY"); }
std::string runtime_directory() { return folder_in("RUNTIME_DIRECTORY"); }

}  // namespace dtact::app
