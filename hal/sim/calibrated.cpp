#include "hal/sim/calibrated.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::hal::sim {
namespace {

using tomlfile::KeyReader;

constexpr double kHair = 1e-6;  // of the thickness: a kink is two knots so far apart

// A number and its standard error, which is not the simulator's.
double estimate(KeyReader& table, const std::string& key, double low, double high) {
  const std::vector<double> pair = table.numbers(key, 0, 1e6);
  if (pair.size() != 2 || pair[0] < low || pair[0] > high) {
    table.fail(key, fmt::format("must be a number from {} to {} and its error", low, high));
  }
  return pair[0];
}

}  // namespace

void take_from_calibration(const std::filesystem::path& folder, Scene& scene) {
  const std::filesystem::path file = folder / "calibration.toml";
  const toml::table parsed = tomlfile::parse(base::read_file(file), file.string());
  KeyReader root(parsed, file.string());
  if (!root.has("gel")) {
    throw std::runtime_error(file.string() +
                             ": has no [gel]: its LUT was not made by a model of the sensor, "
                             "which a simulator of it needs");
  }
  KeyReader gel = root.table("gel");
  scene.gel.thickness_mm = estimate(gel, "thickness_mm", kMinThicknessMm, kMaxThicknessMm);
  OpticsModel& optics = scene.optics;
  optics.narrow_mm = estimate(gel, "narrow_mm", 0, 3);
  optics.wide_mm = estimate(gel, "wide_mm", 0, 6);
  optics.narrow_weight = estimate(gel, "narrow_weight", 0, 1);
  optics.far_weight = 0;
  optics.growth = 0;
  const std::vector<double> knots = gel.numbers("indentation", -1, 1);
  const std::vector<double> slopes = gel.numbers("slope", 1e-4, 1e3);
  if (knots.size() < 2 || slopes.size() != knots.size() ||
      std::ranges::adjacent_find(knots, std::greater_equal()) != knots.end()) {
    gel.fail("indentation", "must ascend and be as many as slope");
  }
  const double bulge_factor = gel.number("bulge_factor", 1e-3, 1e3);
  optics.knots.clear();
  optics.slopes.clear();
  for (std::size_t i = 0; i < knots.size(); ++i) {
    if (knots[i] == 0 && bulge_factor != 1) {
      optics.knots.push_back(-kHair);
      optics.slopes.push_back(bulge_factor * slopes[i]);
    }
    optics.knots.push_back(knots[i]);
    optics.slopes.push_back(knots[i] < 0 ? bulge_factor * slopes[i] : slopes[i]);
  }
}

}  // namespace dtact::hal::sim
