#include "clients/ctl/setup_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "clients/common/exit_codes.hpp"
#include "hal/files/key_reader.hpp"
#include "proto/defaults.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using hal::v4l2::Mode;

constexpr double kWantedPixels = 800 * 600;
constexpr double kWantedFps = 60;
constexpr double kEnoughFps = 30;

void append(const toml::table& table, const std::string& prefix, Settings& settings) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + std::string(name.str());
    if (const toml::table* inner = node.as_table()) {
      append(*inner, key + '.', settings);
    } else if (const auto text = node.value_exact<std::string>()) {
      settings.push_back({key, tomlfile::quoted(*text)});
    } else {
      std::ostringstream value;
      node.visit([&value](const auto& any) { value << any; });
      settings.push_back({key, value.str()});
    }
  }
}

/// "camera.v4l2" and "device" of "camera.v4l2.device".
std::pair<std::string, std::string> split(const std::string& key) {
  const std::size_t dot = key.rfind('.');
  if (dot == std::string::npos) return {"", key};
  return {key.substr(0, dot), key.substr(dot + 1)};
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(std::move(line));
  return lines;
}

/// The table that the line begins.
std::optional<std::string> header_in(const std::string& line) {
  static const std::regex kHeader(R"(\s*\[\s*([A-Za-z0-9_.-]+)\s*\]\s*(#.*)?\r?)");
  std::smatch match;
  return std::regex_match(line, match, kHeader) ? std::optional(match[1].str()) : std::nullopt;
}

/// The line with another value; its comment stays in its column where there is room. Nothing when
/// the line does not set the key, or its value does not end on it.
std::optional<std::string> replaced(const std::string& line, const std::string& key,
                                    const std::string& value) {
  static const std::regex kLine(
      R"re((\s*([A-Za-z0-9_-]+)\s*=\s*)("(?:[^"\\]|\\.)*"|'[^']*'|[^\s#"'\[{][^\s#]*)(\s*)(#.*)?(\r?))re");
  std::smatch match;
  if (!std::regex_match(line, match, kLine) || match[2].str() != key) return std::nullopt;
  std::string space = match[4].str();
  if (match[5].length() > 0) {
    const auto column = static_cast<std::size_t>(match[3].length() + match[4].length());
    space = std::string(column > value.size() ? column - value.size() : 1, ' ');
  }
  return match[1].str() + value + space + match[5].str() + match[6].str();
}

/// Sets the key in its table; adds key and table where they are missing.
void set(std::vector<std::string>& lines, const Setting& setting) {
  const auto [table, key] = split(setting.key);
  std::string here;
  std::optional<std::size_t> last;  // the table's last line that is not empty
  if (table.empty()) last = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (const auto header = header_in(lines[i])) here = *header;
    if (here != table) continue;
    if (const auto line = replaced(lines[i], key, setting.value)) {
      lines[i] = *line;
      return;
    }
    const std::size_t text = lines[i].find_first_not_of(" \t\r");
    // A comment at the end may belong to the table that follows.
    if (text != std::string::npos && lines[i][text] != '#') last = i + 1;
  }
  const std::string line = fmt::format("{} = {}", key, setting.value);
  if (last) {
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(*last), line);
  } else {
    lines.insert(lines.end(), {"", fmt::format("[{}]", table), line});
  }
}

bool holds(const Settings& all, const Setting& wanted, const std::string& where) {
  // As settings_of() writes it: 60 and 60.0 differ, "a" and 'a' do not.
  const auto [table, key] = split(wanted.key);
  const Settings plain = settings_of(fmt::format("{} = {}\n", key, wanted.value), where);
  return std::ranges::any_of(all, [&](const Setting& each) {
    return each.key == wanted.key && each.value == plain.front().value;
  });
}

}  // namespace

Settings settings_of(const std::string& toml, const std::string& where) {
  Settings settings;
  append(tomlfile::parse(toml, where), "", settings);
  return settings;
}

DaemonTarget target_of(const std::string& toml, const std::string& unit, const std::string& where) {
  const toml::table table = tomlfile::parse(toml, where);
  const toml::node_view<const toml::node> address = table.at_path("net.address");
  const std::string listens = address.value_or(std::string(wire::kDefaultAddress));
  if (listens.empty()) {
    const auto socket = table.at_path("net.unix_socket").value_or(std::string());
    // As the daemon reads it: a relative path starts at the configuration's folder.
    if (!socket.empty()) {
      return {"unix:" + fs::absolute(fs::path(where).parent_path() / socket).string(), ""};
    }
    // The RuntimeDirectory of its unit.
    const std::size_t at = unit.find('@');
    const std::string instance = at == std::string::npos ? "" : unit.substr(at + 1);
    return {"unix:" + (fs::path("/run/dtactd") / instance / "dtactd.sock").string(), ""};
  }
  DaemonTarget target;
  // At 0.0.0.0 and :: it can be reached as at the usual address.
  if (listens != wire::kDefaultAddress && listens != "0.0.0.0" && listens != "::") {
    target.host = listens;
  }
  const toml::node_view<const toml::node> port = table.at_path("net.port");
  if (!port) return target;
  const std::int64_t number = port.value_exact<std::int64_t>().value_or(0);
  if (number < 1 || number > 65535) {
    throw cli::Failure(
        cli::kNotMet,
        fmt::format("{}: net.port is no port that can be connected to: set it to a whole number "
                    "from 1 to 65535, as {}",
                    where, wire::kDefaultPort));
  }
  target.port = std::to_string(number);
  return target;
}

std::string with_settings(const std::string& toml, const Settings& settings,
                          const std::string& where) {
  (void)settings_of(toml, where);  // a file with a mistake is refused as it is
  std::vector<std::string> lines = lines_of(toml);
  for (const Setting& setting : settings) set(lines, setting);
  std::string text;
  for (const std::string& line : lines) text += line + '\n';
  for (const Setting& setting : settings) {
    bool done = false;
    try {
      done = holds(settings_of(text, where), setting, where);
    } catch (const std::runtime_error&) {
      done = false;  // set twice, in a way that the lines do not show
    }
    if (!done) {
      throw std::runtime_error(
          fmt::format("{}: cannot set {} without losing what stands there: set "
                      "it to {} by hand and run the command again",
                      where, setting.key, setting.value));
    }
  }
  return text;
}

ModeChoice parse_mode(const std::string& text) {
  static const std::regex kForm(R"((\d{2,4})x(\d{2,4})@(\d{1,3}(\.\d+)?))");
  std::smatch match;
  if (!std::regex_match(text, match, kForm)) {
    throw std::runtime_error(
        fmt::format("\"{}\" is no mode: write width, height and rate as in 800x600@60", text));
  }
  return {std::stoi(match[1]), std::stoi(match[2]), std::stod(match[3])};
}

std::string text_of(const ModeChoice& mode) {
  return fmt::format("{}x{}@{:g}", mode.width, mode.height, mode.fps);
}

std::optional<ModeChoice> best_mode(const std::vector<Mode>& modes) {
  std::vector<ModeChoice> choices;
  for (const Mode& mode : modes) {
    if (!mode.usable()) continue;
    ModeChoice choice{mode.width, mode.height, kEnoughFps};
    if (mode.has_size(800, 600)) choice = {800, 600, kEnoughFps};
    if (!mode.fps.empty() && mode.fps_is_range) {
      choice.fps = std::clamp(kWantedFps, mode.fps.back(), mode.fps.front());
    } else if (!mode.fps.empty()) {
      // Drivers' rates are fractions: 60.00024 is 60. Highest first.
      const auto fits =
          std::ranges::find_if(mode.fps, [](double fps) { return fps <= kWantedFps + 0.5; });
      choice.fps = fits == mode.fps.end() ? mode.fps.back() : *fits;
    }
    choice.fps = std::round(choice.fps * 100) / 100;
    choices.push_back(choice);
  }
  if (choices.empty()) return std::nullopt;
  const auto far = [](const ModeChoice& mode) {
    return std::abs(std::log(double(mode.width) * mode.height / kWantedPixels));
  };
  return *std::ranges::min_element(choices, [&](const ModeChoice& a, const ModeChoice& b) {
    const bool quick_a = a.fps >= kEnoughFps;
    const bool quick_b = b.fps >= kEnoughFps;
    if (quick_a != quick_b) return quick_a;
    if (!quick_a && a.fps != b.fps) return a.fps > b.fps;
    if (far(a) != far(b)) return far(a) < far(b);
    return a.fps > b.fps;
  });
}

std::string board_of(const std::string& model) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 3> kBoards{{
      {"Raspberry Pi 5", "raspberry-pi-5-usb-pio"},
      {"Raspberry Pi 4", "raspberry-pi-4-usb-spi"},
      {"ROCK 5B", "radxa-rock-5b-usb-spi"},
  }};
  for (const auto& [name, board] : kBoards) {
    if (model.find(name) != std::string::npos) return std::string(board);
  }
  return {};
}

}  // namespace dtact::ctl
