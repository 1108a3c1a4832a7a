#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hal/v4l2/survey.hpp"

// What `dtactctl setup` writes into the daemon's configuration.
namespace dtact::ctl {

/// A key of the configuration with its value as TOML writes it.
struct Setting {
  std::string key;    ///< With its tables: "camera.v4l2.device".
  std::string value;  ///< "\"v4l2\"", "800", "60.0", "true".
  bool operator==(const Setting&) const = default;
};
using Settings = std::vector<Setting>;

/// The keys of a configuration that are set, in the order of their tables. Throws
/// std::runtime_error "WHERE:LINE: what is wrong".
[[nodiscard]] Settings settings_of(const std::string& toml, const std::string& where);

/// The text of a configuration with these values; everything else stays, comments included. Throws
/// std::runtime_error naming `where` and the key that has to be set by hand.
[[nodiscard]] std::string with_settings(const std::string& toml, const Settings& settings,
                                        const std::string& where);

/// How programs on this machine reach a daemon, as values of --host and --port; empty: the usual.
struct DaemonTarget {
  std::string host;
  std::string port;
  bool operator==(const DaemonTarget&) const = default;
};

/// The daemon that runs as the service `unit` by this configuration: at its TCP address, or at its
/// socket where it has none. Throws cli::Failure naming `where` and net.port where no program can
/// know the port, std::runtime_error as settings_of() does.
[[nodiscard]] DaemonTarget target_of(const std::string& toml, const std::string& unit,
                                     const std::string& where);

/// A size and rate of the camera.
struct ModeChoice {
  int width = 0;   ///< Pixels.
  int height = 0;  ///< Pixels.
  double fps = 0;
  bool operator==(const ModeChoice&) const = default;
};

/// "800x600@60". Throws std::runtime_error naming the form.
[[nodiscard]] ModeChoice parse_mode(const std::string& text);
/// As parse_mode() reads it.
[[nodiscard]] std::string text_of(const ModeChoice& mode);

/// Of the modes whose format can be read, the size nearest to 800×600 that runs at 30 frames a
/// second or more, at its highest rate up to 60; where none does, the fastest. Nothing without
/// modes.
[[nodiscard]] std::optional<ModeChoice> best_mode(const std::vector<hal::v4l2::Mode>& modes);

/// The name of the board's configuration in config/boards by what the device tree calls the board;
/// empty for a board without one.
[[nodiscard]] std::string board_of(const std::string& model);

}  // namespace dtact::ctl
