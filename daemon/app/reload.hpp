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
};

/// The running configuration with what can change while it runs taken from the fresh one.
[[nodiscard]] Reload merge(const Config& running, const Config& fresh);

/// Whether a key can change while the daemon runs; TLS and tokens only from file to file.
[[nodiscard]] bool is_live(const std::string& key);

}  // namespace dtact::app
