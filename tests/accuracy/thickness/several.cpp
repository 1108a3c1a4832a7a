#include "tests/accuracy/thickness/several.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "hal/sim/objects.hpp"
#include "tests/accuracy/table/judge.hpp"
#include "tests/accuracy/table/methods.hpp"
#include "tests/accuracy/table/sensor.hpp"
#include "tests/accuracy/thickness/thickness.hpp"

namespace dtact::thickness {
namespace {

constexpr double kMax = 0.85;  // of the gel: the simulator's objects reach 0.9

table::Trial draw(std::uint64_t seed, double thickness_mm, const table::Protocol& protocol) {
  table::Trial trial = table::draw(seed, protocol);
  const auto fit = [&](table::BallPress& press) {
    press.depth_mm = std::min(press.depth_mm, kMax * thickness_mm);
  };
  fit(trial.centre);
  std::ranges::for_each(trial.many, fit);
  std::ranges::for_each(trial.tests, fit);
  return trial;
}

/// A reconstructor and its map of one frame.
class Reader {
 public:
  explicit Reader(std::shared_ptr<const recon::Model> model)
      : model_(std::move(model)), reconstructor_(model_), depth_(model_->rectify.entries.size()) {}

  table::Error read(const image::Grey8& frame, const table::TruePress& truth) {
    std::vector<std::uint8_t> luma = frame.pixels;
    luma.resize(luma.size() + recon::kLumaPadding);
    reconstructor_.run(luma.data(), table::kFrameWidth, depth_);
    return table::against_indentation(depth_, truth);
  }

 private:
  std::shared_ptr<const recon::Model> model_;
  recon::Reconstructor reconstructor_;
  std::vector<std::int16_t> depth_;
};

/// The LUT's uncertainty at a depth, linear between its rows like in the daemon, millimetres.
double stated_mm(const recon::Model& model, double depth_mm) {
  recon::Model::Uncertainty below = model.uncertainty.front();
  for (const auto& row : model.uncertainty) {
    if (row.depth_mm >= depth_mm) {
      const double span = row.depth_mm - below.depth_mm;
      const double part = span > 0 ? (depth_mm - below.depth_mm) / span : 1;
      return 0.001 * std::lerp(below.error_um, row.error_um, part);
    }
    below = row;
  }
  return 0.001 * below.error_um;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace

SeveralPresses measure_several(const Specimen& specimen, std::uint64_t seed,
                               const table::Protocol& protocol) {
  SeveralPresses result{.specimen = specimen, .seed = seed, .gain = {}, .ratios = {}};
  const table::Configuration& light = table::configurations()[specimen.configuration];
  hal::sim::Scene scene = sensor_of(specimen.thickness_mm);
  scene.gel.taper_x = specimen.taper_x;

  const table::Trial trial = draw(seed, specimen.thickness_mm, protocol);
  table::Sensor sensor(table::solve(scene, trial.all()), light, seed);
  const table::Material material = table::gather(sensor, trial, light.regression_centre);
  calibration::PressReport report;
  std::shared_ptr<const recon::Model> several;
  try {
    several = table::alone_many(material, &report);
  } catch (const std::runtime_error&) {
    result.gain = "refused";
    return result;
  }
  for (const auto& gain : report.gains) {
    if (gain.chosen) result.gain = gain.name;
  }
  Reader by_several(several);
  Reader by_one(table::alone_single(material));
  table::Error error;
  table::Error one;
  for (std::size_t i = 0; i < trial.tests.size(); ++i) {
    const std::size_t press = 1 + trial.many.size() + i;
    const image::Grey8 frame = sensor.press(press, 1).front();
    const table::TruePress truth =
        table::true_press(sensor.truth(), table::first_still_frame(sensor.truth(), press));
    const table::Error here = by_several.read(frame, truth);
    result.ratios.push_back(here.mean_mm() / stated_mm(*several, 0.5 * trial.tests[i].depth_mm));
    error += here;
    one += by_one.read(frame, truth);
  }
  result.several_mm = error.mean_mm();
  result.one_mm = one.mean_mm();

  scene.presses = {{hal::sim::disc(10), {{1, 0, 0, 0, 0}, {1.1, 0, 0, 0.25, 0}}}};
  scene.gel.solve_step_mm = 5;
  scene.loop_from_s = scene.loop_to_s = 0;
  table::Sensor flat(std::make_shared<const hal::sim::Truth>(scene), light, seed);
  constexpr std::uint64_t kPressed = 90;
  const image::Grey8 frame = flat.frame(kPressed);
  const table::TruePress truth = table::true_press(flat.truth(), kPressed);
  result.flat_several_mm = by_several.read(frame, truth).mean_mm();
  result.flat_one_mm = by_one.read(frame, truth).mean_mm();
  return result;
}

std::string to_markdown(const std::vector<SeveralPresses>& results) {
  using Key = std::tuple<double, double, std::size_t>;
  std::map<Key, std::vector<const SeveralPresses*>> specimens;
  for (const SeveralPresses& r : results) {
    specimens[{r.specimen.taper_x, r.specimen.thickness_mm, r.specimen.configuration}].push_back(
        &r);
  }
  std::string out =
      "| gel, mm | light | 30 presses: 5 mm ball (worst seed) | one press | flat disc: 30 "
      "presses "
      "/ one | true error over stated: median, 95 % | gains chosen |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n";
  for (const auto& [key, rows] : specimens) {
    const auto n = static_cast<double>(
        std::ranges::count_if(rows, [](const SeveralPresses* r) { return !r->ratios.empty(); }));
    double several = 0;
    double worst = 0;
    double one = 0;
    double flat = 0;
    double flat_one = 0;
    std::vector<double> ratios;
    std::map<std::string, int> gains;
    for (const SeveralPresses* r : rows) {
      ++gains[r->gain];
      if (r->ratios.empty()) continue;
      several += r->several_mm / n;
      worst = std::max(worst, r->several_mm);
      one += r->one_mm / n;
      flat += r->flat_several_mm / n;
      flat_one += r->flat_one_mm / n;
      ratios.insert(ratios.end(), r->ratios.begin(), r->ratios.end());
    }
    if (ratios.empty()) continue;
    std::ranges::sort(ratios);
    std::string chosen;
    for (const auto& [gain, count] : gains) {
      chosen += fmt::format("{}{} ×{}", chosen.empty() ? "" : ", ", gain, count);
    }
    const auto [taper, thickness, light] = key;
    fmt::format_to(
        std::back_inserter(out),
        "| {}{} | {} | {:.4f} ({:.4f}) | {:.4f} | {:.4f} / {:.4f} | {:.2f}, {:.2f} | {} |\n",
        thickness, taper == 0 ? "" : fmt::format(", {:.1f} %/mm thicker to the right", 100 * taper),
        table::configurations()[light].name, several, worst, one, flat, flat_one, median(ratios),
        ratios[static_cast<std::size_t>(0.95 * static_cast<double>(ratios.size() - 1))], chosen);
  }
  return out;
}

}  // namespace dtact::thickness
