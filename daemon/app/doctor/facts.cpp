#include "daemon/app/doctor/facts.hpp"

#include <fmt/format.h>
#include <sys/utsname.h>

#include <ostream>
#include <sstream>
#include <string_view>

#include "hal/gpiod/lines.hpp"
#include "hal/v4l2/modes.hpp"
#include "version.hpp"

namespace dtact::app {
namespace {

/// What follows `key` on the first line that begins with it, without quotes and blanks around.
std::string after(const std::string& text, std::string_view key) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t from = line.find_first_not_of(" \t\"", key.size());
    const std::size_t to = line.find_last_not_of(" \t\"");
    return from == std::string::npos || to < from ? "" : line.substr(from, to - from + 1);
  }
  return "";
}

std::string board(const Machine& machine) {
  const std::string model = machine.model();
  return model.empty() ? machine.line("/sys/class/dmi/id/product_name").value_or("") : model;
}

std::string kernel(const Machine& machine) {
  // uname(2) would name the host, too.
  utsname system{};
  ::uname(&system);
  return fmt::format("{} {} {}", machine.line("/proc/sys/kernel/osrelease").value_or(""),
                     machine.line("/proc/sys/kernel/version").value_or(""), system.machine);
}

}  // namespace

void print_facts(const Machine& machine, const hal::Config& config, std::ostream& out) {
  const auto fact = [&out](const char* name, const std::string& value) {
    out << fmt::format("{:<12} {}\n", name, value.empty() ? "unknown" : value);
  };
  fact("dtactd", DTACT_VERSION);
  fact("board", board(machine));
  fact("system", after(machine.text("/etc/os-release"), "PRETTY_NAME="));
  fact("kernel", kernel(machine));
  fact("processors", machine.line("/sys/devices/system/cpu/online").value_or(""));
  fact("memory", after(machine.text("/proc/meminfo"), "MemTotal:"));
  fact("libcamera", DTACT_LIBCAMERA_VERSION);
  fact("libgpiod", hal::gpiod::library_version());
  fact("configured", fmt::format("camera {} {}x{} at {:g} fps, ring {}", config.camera.backend,
                                 config.camera.width, config.camera.height, config.camera.fps,
                                 config.ring.backend));
  for (const hal::v4l2::SurveyedCamera& camera : machine.cameras()) {
    if (!camera.attached.problem.empty()) continue;  // A finding says so.
    fact("attached",
         fmt::format("{} ({}): {}", camera.attached.card, camera.attached.driver,
                     camera.modes.empty() ? "no modes" : hal::v4l2::describe(camera.modes)));
  }
}

}  // namespace dtact::app
