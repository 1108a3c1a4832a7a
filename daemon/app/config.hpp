#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/metrics/endpoint.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/serve/net_config.hpp"
#include "hal/config.hpp"

namespace dtact::app {

/// Begins the path of a file that the service manager hands in: "credential:tokens".
inline constexpr std::string_view kCredential = "credential:";

/// The simulated sensor's calibration, where the package installs it.
inline constexpr const char* kShippedCalibration = "/usr/share/dtactd/simulated";

/// Everything that can be configured. config/dtactd.toml documents every key.
struct Config {
  Config();  ///< The defaults; the capture thread's CPU is the last one this process may use.
  bool cpu_is_default = true;  ///< capture.cpu is not set: several daemons take different CPUs.

  hal::Config hal;
  std::string ring_scheme = "all";  ///< Which LEDs are lit at start (net/light_schemes.hpp).
  pipeline::PipelineConfig pipeline;
  net::NetConfig net;
  bool announce = true;             ///< To the network, where it listens beyond loopback.
  metrics::EndpointConfig metrics;  ///< Port 0: none.
  std::string log_level = "info";   ///< "trace", "debug", "info", "warn", "error".
  /// Folder to run with as long as none that was uploaded is current; empty = none.
  std::filesystem::path calibration;
  /// The same where `calibration` is empty and the camera is the simulated one.
  std::filesystem::path sim_calibration = kShippedCalibration;
  /// What outlives a restart: uploaded calibrations, the last good reference. Empty = systemd's
  /// $STATE_DIRECTORY, else /var/lib/dtactd.
  std::filesystem::path state_dir;
};

/// Where the value of a key came from: "default", "FILE:LINE", "--set", "DTACTD_LOG".
struct KeyOrigin {
  std::string key;
  std::string origin;
};

struct LoadedConfig {
  Config config;
  std::vector<KeyOrigin> origins;  ///< One for each key, in the order of the documentation.
};

/// Reads `file` (none: defaults only), then the environment's DTACTD_LOG, then applies each
/// "key=value" of `settings`; the later wins. Relative paths in a file are relative to its folder;
/// in settings, to the working directory. Throws std::runtime_error with file, line, key and the
/// allowed values.
[[nodiscard]] LoadedConfig load_config(const std::optional<std::filesystem::path>& file,
                                       const std::vector<std::string>& settings);

/// The effective values as TOML, each with where it came from.
void print_config(const LoadedConfig& loaded, std::ostream& out);

}  // namespace dtact::app
