#include "daemon/calibration/force_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <vector>

#include "daemon/recon/scattering.hpp"

namespace dtact::calibration {

std::string format_force(const recon::ForceModel& force) {
  // Where it is left out maps are not sharpened, as in files that are older than the key.
  const std::string steps =
      force.sharpen_steps > 0
          ? fmt::format("sharpen_steps = {}  # of the maps of V and A\n", force.sharpen_steps)
          : "";
  return fmt::format(
      "# Newtons = per_mm3 V + per_mm2 A + per_mm5 V A, of the volume V in mm3 and the area A in "
      "mm2\n"
      "# that are pressed deeper than threshold_mm. error_n: mean absolute, of readings left out; "
      "it\n"
      "# is multiplied by the root of 1 + x S x with x = (V, A, V A) and spread, S's upper "
      "triangle.\n"
      "[force]\nper_mm3 = {}\nper_mm2 = {}\nper_mm5 = {}\nthreshold_mm = {}\n{}error_n = {}\n"
      "spread = [{}]\npairs = {}\nfrom_n = {}\nto_n = {}\n\n",
      force.per_mm3, force.per_mm2, force.per_mm5, force.threshold_mm, steps, force.error_n,
      fmt::join(force.spread, ", "), force.pairs, force.from_n, force.to_n);
}

recon::ForceModel read_force(tomlfile::KeyReader reader) {
  constexpr double kMost = 1e9;
  recon::ForceModel force;
  force.per_mm3 = reader.number("per_mm3", -kMost, kMost);
  force.per_mm2 = reader.number("per_mm2", -kMost, kMost);
  force.per_mm5 = reader.number("per_mm5", -kMost, kMost);
  force.threshold_mm = reader.number("threshold_mm", 0, 10);
  if (reader.has("sharpen_steps")) {
    force.sharpen_steps =
        static_cast<int>(reader.integer("sharpen_steps", 0, recon::kMostSharpeningSteps));
  }
  force.error_n = reader.number("error_n", 0, kMost);
  const std::vector<double> spread = reader.numbers("spread", -kMost, kMost);
  if (spread.size() != force.spread.size()) reader.fail("spread", "expected six numbers");
  std::ranges::copy(spread, force.spread.begin());
  force.pairs = static_cast<int>(reader.integer("pairs", 1, 1'000'000));
  force.from_n = reader.number("from_n", 0, kMost);
  force.to_n = reader.number("to_n", force.from_n, kMost);
  reader.finish();
  return force;
}

}  // namespace dtact::calibration
