#include "daemon/app/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sched.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <ostream>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "daemon/app/config_keys.hpp"
#include "daemon/serve/security.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::app {
namespace {

namespace fs = std::filesystem;

/// The keys and where each value came from, while a configuration is put together.
class Assembly {
 public:
  explicit Assembly(Config& config) : keys_(bind_keys(config)) {
    for (const Key& key : keys_) origins_.push_back({key.path, "default"});
  }

  /// Every value of `table`. `place` makes "FILE:LINE" of a line, `folder` starts relative paths.
  void take(const toml::table& table, const std::string& prefix, const fs::path& folder,
            const std::function<std::string(unsigned)>& place) {
    for (const auto& [name, node] : table) {
      const std::string path = prefix + std::string(name.str());
      const std::string where = place(node.source().begin.line);
      if (const std::string why = why_gone(path, node); !why.empty()) {
        throw std::runtime_error(fmt::format("{}: {}: {}", where, path, why));
      }
      const auto key =
          std::find_if(keys_.begin(), keys_.end(), [&](const Key& k) { return k.path == path; });
      if (key != keys_.end()) {
        if (!key->assign(node, folder)) {
          throw std::runtime_error(fmt::format("{}: {}: must be {}", where, path, key->allowed));
        }
        origins_[static_cast<std::size_t>(key - keys_.begin())].origin = where;
      } else if (node.is_table() && is_table_name(path)) {
        take(*node.as_table(), path + ".", folder, place);
      } else {
        throw std::runtime_error(fmt::format("{}: unknown key \"{}\"; allowed here are {}", where,
                                             path, fmt::join(siblings(prefix), ", ")));
      }
    }
  }

  [[nodiscard]] std::vector<KeyOrigin> origins() && { return std::move(origins_); }

 private:
  [[nodiscard]] bool is_table_name(const std::string& path) const {
    return std::any_of(keys_.begin(), keys_.end(),
                       [&](const Key& k) { return k.path.starts_with(path + "."); });
  }

  /// The valid names in the table `prefix`.
  [[nodiscard]] std::vector<std::string> siblings(const std::string& prefix) const {
    std::vector<std::string> names;
    for (const Key& key : keys_) {
      if (!key.path.starts_with(prefix)) continue;
      const std::string rest = key.path.substr(prefix.size());
      const std::size_t dot = rest.find('.');
      std::string name = dot == std::string::npos ? rest : "[" + rest.substr(0, dot) + "]";
      if (std::find(names.begin(), names.end(), name) == names.end()) {
        names.push_back(std::move(name));
      }
    }
    return names;
  }

  std::vector<Key> keys_;
  std::vector<KeyOrigin> origins_;
};

/// "key=value" as TOML. A value that is no TOML by itself is taken as a string, so that
/// `camera.backend=replay` needs no quotes within the shell's.
toml::table parse_setting(const std::string& setting) {
  const std::size_t equals = setting.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw std::runtime_error(
        fmt::format("--set {}: must be KEY=VALUE, as in camera.fps=30", setting));
  }
  const std::string key = setting.substr(0, equals);
  const std::string value = setting.substr(equals + 1);
  const std::string where = "--set " + setting;
  try {
    return tomlfile::parse(fmt::format("{} = {}", key, value), where);
  } catch (const std::runtime_error&) {
    const toml::value<std::string> text(value);
    toml::table line;
    line.insert("text", text);
    std::ostringstream quoted;
    quoted << toml::toml_formatter(line);
    return tomlfile::parse(key + quoted.str().substr(std::string_view("text").size()), where);
  }
}

/// What else has to be set for frames to be decoded at a smaller size. A recording has a size and a
/// format of its own.
void check_decode_scale(const hal::CameraConfig& camera) {
  const int scale = camera.decode_scale;
  const std::map<std::string, std::pair<std::string, std::string>> formats = {
      {"sim", {"camera.sim.output", camera.sim.output}},
      {"v4l2", {"camera.v4l2.pixel_format", camera.v4l2.pixel_format}},
      {"libcamera", {"camera.libcamera.pixel_format", camera.libcamera.pixel_format}},
      {"null", {"camera.backend", camera.backend}}};
  const auto found = formats.find(camera.backend);
  if (scale != 1 && found != formats.end()) {
    const auto& [key, value] = found->second;
    if (value != "mjpeg" && value != "auto") {
      throw std::runtime_error(
          fmt::format("camera.decode_scale = {} needs MJPEG, which {} = \"{}\" does not give: set "
                      "camera.decode_scale = 1 or take MJPEG",
                      scale, key, value));
    }
  }
  const bool divides = camera.width % scale == 0 && camera.height % scale == 0;
  if (divides || camera.backend == "replay") return;
  throw std::runtime_error(fmt::format(
      "camera.decode_scale = {} does not divide frames of {}x{} pixels: set 1, or 2 or 4 "
      "where width and height are multiples of it",
      scale, camera.width, camera.height));
}

/// A wait that ends before its frames have come never ends in a reference.
void check_reference(const pipeline::ReferenceRules& rules) {
  for (const auto& [key, frames] :
       {std::pair("frames", rules.frames), std::pair("settle_frames", rules.settle_frames)}) {
    if (rules.timeout_frames >= frames) continue;
    throw std::runtime_error(fmt::format(
        "reference.timeout_frames = {} must be at least reference.{} = {}: no reference would "
        "ever be taken",
        rules.timeout_frames, key, frames));
  }
}

}  // namespace

Config::Config() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (::sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &allowed)) pipeline.cpu = cpu;
  }
}

LoadedConfig load_config(const std::optional<fs::path>& file,
                         const std::vector<std::string>& settings) {
  LoadedConfig loaded;
  Assembly assembly(loaded.config);
  if (file) {
    const std::string name = file->string();
    const toml::table table = tomlfile::parse(base::read_file(*file), name);
    assembly.take(table, "", fs::absolute(*file).parent_path(),
                  [&](unsigned line) { return fmt::format("{}:{}", name, line); });
  }
  if (const char* level = std::getenv("DTACTD_LOG"); level != nullptr) {
    toml::table table;
    table.insert("log_level", level);
    assembly.take(table, "", {}, [](unsigned) { return "DTACTD_LOG"; });
  }
  for (const std::string& setting : settings) {
    assembly.take(parse_setting(setting), "", fs::current_path(),
                  [&](unsigned) { return "--set"; });
  }
  check_decode_scale(loaded.config.hal.camera);
  check_reference(loaded.config.pipeline.reference);
  const pipeline::ContactRules& contact = loaded.config.pipeline.contact;
  if (contact.release_mm >= contact.threshold_mm) {
    throw std::runtime_error(fmt::format(
        "contact.release_mm = {} must be less than contact.threshold_mm = {}: contact would "
        "flicker",
        contact.release_mm, contact.threshold_mm));
  }
  const hal::GpioLineConfig& power = loaded.config.hal.ring.ws2812.power;
  if (power.is_set() && (power.line >= 0) != power.name.empty()) {
    throw std::runtime_error(fmt::format(
        "ring.ws2812.power: line = {} and name = \"{}\": set the one or the other (-1 and \"\" are "
        "none)",
        power.line, power.name));
  }
  const int capture = loaded.config.pipeline.fifo_priority;
  const int network = loaded.config.net.fifo_priority;
  if (capture > 0 && network >= capture) {
    throw std::runtime_error(fmt::format(
        "net.fifo_priority = {} must be less than capture.fifo_priority = {}: clients would "
        "delay frames",
        network, capture));
  }
  net::check_security(loaded.config.net);
  loaded.origins = std::move(assembly).origins();
  loaded.config.cpu_is_default =
      std::ranges::find(loaded.origins, "capture.cpu", &KeyOrigin::key)->origin == "default";
  return loaded;
}

void print_config(const LoadedConfig& loaded, std::ostream& out) {
  Config config = loaded.config;
  const std::vector<Key> keys = bind_keys(config);
  std::string table;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::size_t dot = keys[i].path.rfind('.');
    const std::string here = dot == std::string::npos ? "" : keys[i].path.substr(0, dot);
    if (here != table) out << "\n[" << here << "]\n";
    table = here;
    const std::string name = keys[i].path.substr(dot == std::string::npos ? 0 : dot + 1);
    out << fmt::format("{:<40} # {}\n", fmt::format("{} = {}", name, keys[i].show()),
                       loaded.origins[i].origin);
  }
}

}  // namespace dtact::app
