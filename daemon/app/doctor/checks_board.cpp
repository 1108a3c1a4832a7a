#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <string_view>

#include "daemon/app/doctor/checks.hpp"

namespace dtact::app {
namespace {

/// What stands after the "=" of the firmware's answer; empty when there is none.
std::string value_of(const std::string& answer) {
  const std::size_t equals = answer.find('=');
  return equals == std::string::npos ? "" : answer.substr(equals + 1);
}

bool has_line(const std::string& text, std::string_view wanted) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line == wanted) return true;
  }
  return false;
}

struct Trouble {
  unsigned bit;  ///< the present state; the state since the start is 16 bits above
  const char* name;
  const char* fix;
};
// According to the Raspberry Pi's documentation of vcgencmd, under get_throttled.
constexpr std::array<Trouble, 4> kTroubles{{
    {0, "under-voltage", "a supply and a cable made for this board; then vcgencmd get_throttled"},
    {1, "processor clock capped", "see under-voltage; vcgencmd measure_clock arm"},
    {2, "throttled", "see under-voltage; cool the board; vcgencmd measure_temp"},
    {3, "soft temperature limit", "cool the board; vcgencmd measure_temp"},
}};

}  // namespace

Findings check_core_clock(const Machine& machine, const hal::RingConfig& ring) {
  const std::string model = machine.model();
  // A Raspberry Pi 5's header SPI has a clock of its own.
  const bool four = model.starts_with("Raspberry Pi 4") || model.find("Module 4") != model.npos;
  const bool three = model.starts_with("Raspberry Pi 3") || model.find("Module 3") != model.npos;
  if (ring.backend != "ws2812_spi" || (!four && !three)) return {};
  const std::string path = "/boot/firmware/config.txt";
  const std::string config = machine.text(path);
  const std::string wanted = four ? "core_freq_min=500" : "core_freq=250";
  const std::string lines = four ? "core_freq=500\\ncore_freq_min=500" : "core_freq=250";
  const std::string hertz = value_of(machine.firmware("measure_clock core"));
  const std::string now =
      hertz.empty() ? ""
                    : fmt::format(", now {:.0f} MHz", std::strtod(hertz.c_str(), nullptr) / 1e6);
  for (const std::string& holds : {wanted, std::string("force_turbo=1")}) {
    if (has_line(config, holds)) {
      return {{Verdict::good, fmt::format("{} has {}{}", path, holds, now), ""}};
    }
  }
  return {{Verdict::note,
           fmt::format("{}: the core clock, from which the SPI's is divided, moves with load{}",
                       model, now),
           fmt::format("printf '{}\\n' | sudo tee -a {} && sudo reboot", lines, path)}};
}

Findings check_throttling(const Machine& machine) {
  if (!machine.model().starts_with("Raspberry Pi")) return {};
  const std::string answer = machine.firmware("get_throttled");
  if (value_of(answer).empty()) {
    return {{Verdict::note, "the firmware cannot be asked for under-voltage and heat",
             "vcgencmd get_throttled, as a member of the group video"}};
  }
  const unsigned long bits = std::strtoul(value_of(answer).c_str(), nullptr, 16);
  Findings findings;
  for (const Trouble& trouble : kTroubles) {
    const bool now = (bits >> trouble.bit & 1U) != 0;
    const bool before = (bits >> (trouble.bit + 16) & 1U) != 0;
    if (!now && !before) continue;
    findings.push_back(
        {now ? Verdict::wrong : Verdict::note,
         fmt::format("{}: {} {}", answer, trouble.name, now ? "now" : "since the board started"),
         trouble.fix});
  }
  if (findings.empty()) return {{Verdict::good, answer, ""}};
  return findings;
}

Findings check_groups(const Machine& machine) {
  const std::string groups = "\n" + machine.text("/etc/group");
  std::string missing;
  for (const char* group : {"video", "spi", "gpio"}) {
    if (groups.find(fmt::format("\n{}:", group)) != std::string::npos) continue;
    missing += (missing.empty() ? "" : ", ") + std::string(group);
  }
  if (missing.empty()) return {{Verdict::good, "video, spi and gpio are there", ""}};
  return {{Verdict::note, fmt::format("missing: {}; their devices stay root's", missing),
           machine.has("/usr/lib/sysusers.d/dtactd.conf")
               ? "sudo systemd-sysusers"
               : "sudo cp systemd/dtactd.sysusers /etc/sysusers.d/dtactd.conf && sudo "
                 "systemd-sysusers"}};
}

}  // namespace dtact::app
