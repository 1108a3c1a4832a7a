#include "daemon/app/doctor/doctor.hpp"

#include <fmt/format.h>

#include <ostream>

#include "daemon/app/doctor/checks.hpp"

namespace dtact::app {

int doctor(const hal::Config& config, std::ostream& out) {
  const Machine machine;
  int wrong = 0;
  const auto print = [&](const char* subject, const Findings& findings) {
    for (const Finding& finding : findings) {
      const char* verdict = finding.verdict == Verdict::good   ? "ok"
                            : finding.verdict == Verdict::note ? "note"
                                                               : "WRONG";
      wrong += finding.verdict == Verdict::wrong ? 1 : 0;
      out << fmt::format("{:<12} {:<6} {}\n", subject, verdict, finding.what);
      if (!finding.mend.empty()) out << fmt::format("{:<12} {:<6} {}\n", "", "mend:", finding.mend);
    }
  };
  print("camera", check_camera(machine, config.camera));
  print("spi", check_spi(machine, config.ring));
  print("core clock", check_core_clock(machine, config.ring));
  print("gpio", check_gpio(machine, config.ring));
  print("real time", check_realtime(machine));
  print("clock source", check_clock_source(machine));
  print("governor", check_governor(machine));
  out << (wrong == 0 ? std::string("nothing is wrong\n")
                     : fmt::format("{} {} wrong\n", wrong, wrong == 1 ? "thing is" : "things are"));
  return wrong == 0 ? 0 : 1;
}

}  // namespace dtact::app
