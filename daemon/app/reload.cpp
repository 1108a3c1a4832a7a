#include "daemon/app/reload.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "daemon/app/config_keys.hpp"

namespace dtact::app {
namespace {

constexpr std::array<std::string_view, 8> kLive = {"log_level",
                                                   "net.tls_certificate",
                                                   "net.tls_key",
                                                   "net.tokens",
                                                   "net.max_clients",
                                                   "net.max_clients_per_address",
                                                   "net.max_requests_per_s",
                                                   "net.hello_timeout_ms"};

/// Whether clients would meet another kind of door: with TLS or without, with a token or without.
bool switches(const std::string& before, const std::string& after) {
  constexpr const char* kNone = "\"\"";
  return before == kNone || after == kNone;
}

}  // namespace

bool is_live(const std::string& key) {
  return std::find(kLive.begin(), kLive.end(), key) != kLive.end();
}

Reload merge(const Config& running, const Config& fresh) {
  Reload reload;
  reload.config = running;
  Config wanted = fresh;
  const std::vector<Key> keys = bind_keys(reload.config);
  const std::vector<Key> news = bind_keys(wanted);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string before = keys[i].show();
    const std::string after = news[i].show();
    // A default is another CPU for each daemon of the machine.
    const bool chosen =
        keys[i].path == "capture.cpu" && running.cpu_is_default != fresh.cpu_is_default;
    if (before == after && !chosen) continue;
    if (!is_live(keys[i].path) || switches(before, after)) {
      reload.restart.push_back(keys[i].path);
      continue;
    }
    const toml::table line = toml::parse("value = " + after);
    (void)keys[i].assign(*line.get("value"), "/");  // it has passed this check already
    reload.changed.push_back(keys[i].path);
  }
  const net::NetConfig& net = reload.config.net;
  for (const auto& [key, file] :
       {std::pair("net.tls_certificate", &net.tls_certificate),
        std::pair("net.tls_key", &net.tls_key), std::pair("net.tokens", &net.token_file)}) {
    if (file->empty()) continue;
    (file->string().starts_with(kCredential) ? reload.credentials : reload.files).push_back(key);
  }
  return reload;
}

std::string what_was_read(const Reload& reload) {
  std::string read = "configuration read again";
  if (!reload.files.empty()) {
    read += fmt::format(", and with it the files of {}", fmt::join(reload.files, ", "));
  }
  return fmt::format(
      "{}; changed: {}", read,
      reload.changed.empty() ? "nothing" : fmt::format("{}", fmt::join(reload.changed, ", ")));
}

std::string what_waits(const Reload& reload) {
  std::string waits;
  if (!reload.restart.empty()) {
    waits = fmt::format("needs a restart: {}", fmt::join(reload.restart, ", "));
  }
  if (!reload.credentials.empty()) {
    waits += fmt::format("{}new credentials need a restart: {}", waits.empty() ? "" : "; ",
                         fmt::join(reload.credentials, ", "));
  }
  return waits;
}

}  // namespace dtact::app
