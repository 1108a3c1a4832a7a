#pragma once

#include <string>
#include <vector>

#include "daemon/app/config.hpp"

namespace dtact::app {

/// What a configuration that is read again changes in a running daemon.
struct Reload {
  Config config;                     ///< To run with from now on.
  std::vector<std::string> changed;  ///< Keys that take their new value in it, …
  std::vector<std::string> restart;  ///< … and those that keep the old one until a restart.
  std::vector<std::string> files;    ///< Keys whose files are reloaded with the configuration, …
  /// … and those passed in by systemd, which may not pass them again before a restart.
  std::vector<std::string> credentials;
};

/// The running configuration with what can change while it runs taken from the fresh one.
[[nodiscard]] Reload merge(const Config& running, const Config& fresh);

/// What there is to say of a reload: the log's line, …
[[nodiscard]] std::string what_was_read(const Reload& reload);
/// … and what waits for a restart; empty when nothing does.
[[nodiscard]] std::string what_waits(const Reload& reload);

/// Whether a key can change while the daemon runs; TLS and tokens only from file to file.
[[nodiscard]] bool is_live(const std::string& key);

}  // namespace dtact::app
