// held_out_forces [SEED] [COUNT] [ball|flat] [SHARPEN]: the force on objects that were not used in
// its calibration, on gels of 1.5 to 3 mm, as CSV; the distribution on standard error.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/accuracy/force/held_out.hpp"

int main(int argc, char** argv) {
  namespace force = dtact::force;
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  const auto number = [&](std::size_t at, int without) {
    return arguments.size() > at ? std::stoi(arguments[at]) : without;
  };
  const bool flat = arguments.size() > 2 && arguments[2] == "flat";
  const auto folder = std::filesystem::temp_directory_path() /
                      fmt::format("held_out_forces.{}", static_cast<const void*>(&arguments));
  std::vector<double> ratios;
  std::vector<double> shares;
  int without = 0;
  fmt::print("object,thickness_mm,depth_mm,true_n,force_n,uncertainty_n,ratio,absence\n");
  for (const double thickness : {1.5, 2.0, 2.5, 3.0}) {
    std::filesystem::remove_all(folder);
    const force::Trial trial = force::try_held_out(
        thickness, flat ? force::Calibrating::ball_and_flat_end : force::Calibrating::ball,
        static_cast<std::uint64_t>(number(0, 1) + static_cast<int>(100 * thickness)), number(1, 12),
        folder, number(3, 0));
    fmt::print(stderr, "{} mm: {}\n", thickness, trial.calibration);
    for (const force::HeldOut& press : trial.presses) {
      fmt::print("{},{},{:.3f},{:.4f},{:.4f},{:.4f},{:.2f},{}\n", press.object, thickness,
                 press.depth_mm, press.true_n, press.force_n, press.uncertainty_n,
                 press.valid ? force::ratio(press) : 0,
                 dtact::v1::ForceAbsence_Name(press.absence).substr(14));
      without += press.valid ? 0 : 1;
      if (!press.valid) continue;
      ratios.push_back(force::ratio(press));
      if (press.in_contact) shares.push_back(std::abs(press.force_n / press.true_n - 1));
    }
  }
  std::filesystem::remove_all(folder);
  fmt::print(
      stderr,
      "{} presses, {} without a force; error over stated: {:.2f} at the median, {:.2f} at 95 "
      "%; error over force: {:.3f}, {:.3f}\n",
      ratios.size(), without, force::quantile(ratios, 0.5), force::quantile(ratios, 0.95),
      force::quantile(shares, 0.5), force::quantile(shares, 0.95));
  return 0;
}
