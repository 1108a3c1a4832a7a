#include "daemon/app/doctor/doctor.hpp"

#include <fmt/format.h>

#include <ostream>
#include <vector>

#include "daemon/app/doctor/checks.hpp"
#include "daemon/app/doctor/facts.hpp"

namespace dtact::app {
namespace {

struct Subject {
  const char* name;
  Findings findings;
};

std::vector<Subject> examine(const Machine& machine, const hal::Config& config) {
  return {{"camera", check_camera(machine, config.camera)},
          {"usb", check_usb_speed(machine, config.camera)},
          {"dma heap", check_dma_heap(machine, config.camera)},
          {"ipa", check_ipa(machine, config.camera)},
          {"spi", check_spi(machine, config.ring)},
          {"core clock", check_core_clock(machine, config.ring)},
          {"pio", check_pio(machine, config.ring)},
          {"gpio", check_gpio(machine, config.ring)},
          {"groups", check_groups(machine)},
          {"power", check_throttling(machine)},
          {"real time", check_realtime(machine)},
          {"rt share", check_realtime_share(machine)},
          {"memory", check_memory(machine)},
          {"clock source", check_clock_source(machine)},
          {"governor", check_governor(machine)}};
}

/// Returns how many are wrong. With `with_fixes`, the command stands under each.
int print(const std::vector<Subject>& subjects, bool with_fixes, std::ostream& out) {
  int wrong = 0;
  for (const Subject& subject : subjects) {
    for (const Finding& finding : subject.findings) {
      const char* verdict = finding.verdict == Verdict::good   ? "ok"
                            : finding.verdict == Verdict::note ? "note"
                                                               : "WRONG";
      wrong += finding.verdict == Verdict::wrong ? 1 : 0;
      out << fmt::format("{:<12} {:<6} {}\n", subject.name, verdict, finding.what);
      if (with_fixes && !finding.fix.empty()) {
        out << fmt::format("{:<12} {:<6} {}\n", "", "fix:", finding.fix);
      }
    }
  }
  out << (wrong == 0 ? std::string("nothing is wrong\n")
                     : fmt::format("{} {} wrong\n", wrong, wrong == 1 ? "thing is" : "things are"));
  return wrong;
}

}  // namespace

int doctor(const hal::Config& config, std::ostream& out, const Machine& machine) {
  return print(examine(machine, config), true, out) == 0 ? 0 : 1;
}

void report(const hal::Config& config, std::ostream& out, const Machine& machine) {
  print_facts(machine, config, out);
  // Without the commands, which name the user.
  (void)print(examine(machine, config), false, out);
}

}  // namespace dtact::app
