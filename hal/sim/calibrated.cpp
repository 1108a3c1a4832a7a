#include "hal/sim/calibrated.hpp"

#include <stdexcept>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/toml/key_reader.hpp"

namespace dtact::hal::sim {
namespace {

using tomlfile::KeyReader;

// Where the slopes of [layer] stand, in thicknesses (clients/calibrate/fit/model/layer_model.hpp).
const std::vector<double> kKnots = {-0.24, -0.12, 0, 0.4, 0.8};
constexpr double kHair = 1e-6;  // of the thickness: a kink is two knots so far apart

}  // namespace

void take_from_calibration(const std::filesystem::path& folder, Scene& scene) {
  const std::filesystem::path file = folder / "calibration.toml";
  const toml::table parsed = tomlfile::parse(base::read_file(file), file.string());
  KeyReader root(parsed, file.string());
  if (!root.has("layer") || !root.has("scattering")) {
    throw std::runtime_error(file.string() +
                             ": has no [layer] and [scattering]: its list was not made by a model "
                             "of the sensor, which a simulator of it needs");
  }
  // What else the tables hold (uncertainties) is not the simulator's.
  KeyReader layer = root.table("layer");
  scene.layer.thickness_mm = layer.number("thickness_mm", 0.5, 5);
  OpticsModel& optics = scene.optics;
  optics.knots = kKnots;
  optics.slopes = layer.numbers("slopes", 0.001, 20);
  if (optics.slopes.size() != optics.knots.size()) {
    layer.fail("slopes", "must be as many as the model has knots: 5");
  }
  double bulge_factor = 1;
  layer.number_if("bulge_factor", bulge_factor, 0.05, 20);
  if (bulge_factor != 1) {
    optics.knots = {-0.24, -0.12, -kHair, 0, 0.4, 0.8};
    const std::vector<double> s = optics.slopes;
    optics.slopes = {
        bulge_factor * s[0], bulge_factor * s[1], bulge_factor * s[2], s[2], s[3], s[4]};
  }
  KeyReader scattering = root.table("scattering");
  optics.narrow_mm = scattering.number("narrow_mm", 0, 3);
  optics.wide_mm = scattering.number("wide_mm", 0, 6);
  optics.narrow_weight = scattering.number("narrow_weight", 0, 1);
  optics.far_weight = 0;
  optics.growth = 0;
}

}  // namespace dtact::hal::sim
