#include "hal/gpiod/lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "hal/base/device_allow.hpp"

namespace dtact::hal::gpiod {
namespace {

namespace fs = std::filesystem;

struct Survey {
  std::vector<Chip> chips;
  int denied = 0;  // EACCES or EPERM: another chip is there, which this program may not open
};

Survey survey() {
  std::vector<fs::path> paths;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/dev", ignored)) {
    if (entry.path().filename().string().starts_with("gpiochip")) paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  Survey survey;
  for (const fs::path& path : paths) {
    if (fs::is_symlink(path, ignored)) continue;
    ChipFacts facts = read_chip(path);
    if (facts.error == 0) survey.chips.push_back(std::move(facts.chip));
    if (facts.error == EACCES || facts.error == EPERM) survey.denied = facts.error;
  }
  // Raspberry Pi OS links gpiochip4 to gpiochip0, for programs from before kernel 6.6.45
  // (raspberrypi-sys-mods, 60-gpiochip4.rules).
  for (const fs::path& path : paths) {
    if (!fs::is_symlink(path, ignored)) continue;
    const fs::path target = fs::weakly_canonical(path, ignored);
    for (Chip& chip : survey.chips) {
      if (target == chip.path) chip.links.push_back(path);
    }
  }
  return survey;
}

bool goes_by(const Chip& chip, const std::string& name) {
  const auto is = [&](const fs::path& path) { return path == name || path.filename() == name; };
  return is(chip.path) || chip.label == name ||
         std::any_of(chip.links.begin(), chip.links.end(), is);
}

std::string known(const std::vector<Chip>& chips) {
  std::string text;
  for (const Chip& chip : chips) {
    text += fmt::format("{}{} ({}, {} lines)", text.empty() ? "" : ", ", chip.path, chip.label,
                        chip.lines);
  }
  return text.empty() ? "none that this user may open" : text;
}

}  // namespace

std::vector<Chip> list_chips() { return survey().chips; }

Place find_line(const std::vector<Chip>& chips, const GpioLineConfig& line,
                const std::string& key) {
  std::vector<const Chip*> meant;
  for (const Chip& chip : chips) {
    if (line.chip.empty() || goes_by(chip, line.chip)) meant.push_back(&chip);
  }
  if (meant.empty()) {
    return {{}, -1, "no such chip that this user may open", "chips here: " + known(chips), true};
  }
  if (line.name.empty()) {
    const Chip& chip = *meant.front();
    if (line.line >= 0 && line.line < chip.lines) return {chip.path, line.line, {}, {}};
    return {{},
            -1,
            fmt::format("it has lines 0 … {}", chip.lines - 1),
            fmt::format("gpioinfo {}, then set {}.line or .name", chip.path, key)};
  }
  // The kernel lets several lines bear one name.
  std::vector<Place> found;
  for (const Chip* chip : meant) {
    for (std::size_t i = 0; i < chip->names.size(); ++i) {
      if (chip->names[i] == line.name) found.push_back({chip->path, static_cast<int>(i), {}, {}});
    }
  }
  if (found.empty()) return {{}, -1, "no line has this name", "gpioinfo lists the names", true};
  if (found.size() == 1) return found.front();
  return {{},
          -1,
          fmt::format("{} line {} has this name and {} line {} has it too", found[0].chip,
                      found[0].line, found[1].chip, found[1].line),
          fmt::format("set {0}.chip and {0}.line instead of the name", key)};
}

std::string describe(const GpioLineConfig& line) {
  const std::string which =
      line.name.empty() ? fmt::format("line {}", line.line) : fmt::format("line \"{}\"", line.name);
  return line.chip.empty() ? which : fmt::format("chip \"{}\" {}", line.chip, which);
}

std::string holder_name(const char* consumer) {
  const std::string name = consumer == nullptr ? "" : consumer;
  return name.empty() || name == "?" ? "something that gave no name" : '"' + name + '"';
}

std::unique_ptr<OutputLine> open_output(const GpioLineConfig& line, bool active,
                                        const std::string& key) {
  const auto fail = [&](const std::string& why, const std::string& fix) {
    return std::runtime_error(fmt::format("{}: {}: {}: {}", key, describe(line), why, fix));
  };
  const Survey here = survey();
  const Place place = find_line(here.chips, line, key);
  if (place.unknown && here.denied != 0) {
    throw fail(std::strerror(here.denied),
               here.denied == EPERM
                   ? base::kDeviceAllowFix
                   : "put the user into the group that owns it (sudo usermod -aG gpio <user>) and "
                     "install config/udev/60-dtactd.rules");
  }
  if (!place.why.empty()) throw fail(place.why, place.fix);
  int error = 0;
  auto output = request_output(place.chip, place.line, line, active, error);
  if (output != nullptr) return output;
  if (error != EBUSY) throw fail(std::strerror(error), "gpioinfo " + place.chip + ", dmesg");
  const std::string holder = line_holder(place.chip, place.line);
  throw fail(std::strerror(error),
             fmt::format("it is in use by {}; free it or choose another line: "
                         "gpioinfo {}",
                         holder.empty() ? holder_name(nullptr) : holder, place.chip));
}

}  // namespace dtact::hal::gpiod
