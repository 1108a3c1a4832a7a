#include "hal/gpiod/lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace dtact::hal::gpiod {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> chip_paths() {
  std::vector<std::string> paths;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/dev", ignored)) {
    if (entry.path().filename().string().starts_with("gpiochip")) paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

/// The chip's path, or empty. `error` becomes EACCES when a chip might be it but may not be read.
std::string resolve(const std::string& name, int& error) {
  error = ENOENT;
  for (const std::string& path : chip_paths()) {
    if (path == name || fs::path(path).filename() == name) return path;
    const ChipFacts facts = read_chip(path);
    if (facts.error == 0 && facts.chip.label == name) return path;
    if (facts.error == EACCES || facts.error == EPERM) error = EACCES;
  }
  return {};
}

std::string known_chips() {
  std::string text;
  for (const Chip& chip : list_chips()) {
    text += fmt::format("{}{} ({}, {} lines)", text.empty() ? "" : ", ", chip.path, chip.label,
                        chip.lines);
  }
  return text.empty() ? "none that this user may open" : text;
}

std::string remedy(int error, const std::string& path, const GpioLineConfig& line) {
  switch (error) {
    case EACCES:
    case EPERM:
      return "put the user into the group that owns it (sudo usermod -aG gpio <user>) and install "
             "config/udev/60-dtactd.rules";
    case EBUSY: {
      const std::string holder = line_holder(path, line.line);
      return fmt::format("it is in use by {}; free it or choose another line",
                         holder.empty() ? "something that gave no name" : '"' + holder + '"');
    }
    default:
      return fmt::format("chips here: {}", known_chips());
  }
}

}  // namespace

std::vector<Chip> list_chips() {
  std::vector<Chip> chips;
  for (const std::string& path : chip_paths()) {
    ChipFacts facts = read_chip(path);
    if (facts.error == 0) chips.push_back(std::move(facts.chip));
  }
  return chips;
}

std::unique_ptr<OutputLine> open_output(const GpioLineConfig& line, bool active,
                                        const std::string& key) {
  int error = 0;
  const auto fail = [&](const std::string& path) {
    return std::runtime_error(fmt::format("{}: chip \"{}\" line {}: {}: {}", key, line.chip,
                                          line.line, std::strerror(error),
                                          remedy(error, path, line)));
  };
  const std::string path = resolve(line.chip, error);
  if (path.empty()) throw fail(line.chip);
  const ChipFacts facts = read_chip(path);
  if (facts.error != 0) {
    error = facts.error;
    throw fail(path);
  }
  if (line.line < 0 || line.line >= facts.chip.lines) {
    throw std::runtime_error(fmt::format("{}: line {} of chip \"{}\": it has lines 0 … {}", key,
                                         line.line, line.chip, facts.chip.lines - 1));
  }
  auto output = request_output(path, line, active, error);
  if (output == nullptr) throw fail(path);
  return output;
}

}  // namespace dtact::hal::gpiod
