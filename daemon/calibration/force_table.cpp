#include "daemon/calibration/force_table.hpp"

#include <fmt/format.h>

#include <string>

namespace dtact::calibration {

std::string format_force(const recon::ForceModel& force) {
  return fmt::format(
      "# Force of an incompressible gel bonded to a stiff block, indented by depth + zero_mm.\n"
      "# error_share: of the force, mean absolute, of readings left out.\n"
      "[force]\nmodulus_mpa = {}\nthickness_mm = {}\nzero_mm = {}\nerror_share = {}\npairs = {}\n"
      "from_n = {}\nto_n = {}\n\n",
      force.modulus_mpa, force.thickness_mm, force.zero_mm, force.error_share, force.pairs,
      force.from_n, force.to_n);
}

recon::ForceModel read_force(tomlfile::KeyReader reader) {
  constexpr double kMaxN = 1e6;
  recon::ForceModel force;
  force.modulus_mpa = reader.number("modulus_mpa", 1e-3, 1e3);
  force.thickness_mm = reader.number("thickness_mm", 0.5, 5);
  force.zero_mm = reader.number("zero_mm", -1, 1);
  force.error_share = reader.number("error_share", 0, 1);
  force.pairs = static_cast<int>(reader.integer("pairs", 1, 1'000'000));
  force.from_n = reader.number("from_n", 0, kMaxN);
  force.to_n = reader.number("to_n", force.from_n, kMaxN);
  reader.finish();
  return force;
}

}  // namespace dtact::calibration
