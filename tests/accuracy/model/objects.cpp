#include "tests/accuracy/model/objects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/model/model_fit.hpp"
#include "hal/sim/scene.hpp"
#include "tests/accuracy/table/another_law.hpp"
#include "tests/accuracy/table/judge.hpp"
#include "tests/accuracy/table/methods.hpp"
#include "tests/accuracy/table/sensor.hpp"

namespace dtact::model_study {
namespace {

hal::sim::Scene all_objects(table::Law law = table::Law::built_in) {
  hal::sim::Scene scene = hal::sim::load_scene(DTACT_SOURCE_DIR "/config/scenes/all_objects.toml");
  if (law == table::Law::another) {
    const hal::sim::Scene other = table::another_law();
    const double solve_step_mm = scene.gel.solve_step_mm;
    scene.gel = other.gel;
    scene.gel.solve_step_mm = solve_step_mm;
    scene.optics = other.optics;
  }
  return scene;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double rms_mm(std::span<const std::int16_t> depth_um) {
  double sum = 0;
  for (const double um : depth_um) sum += um * um;
  return 0.001 * std::sqrt(sum / static_cast<double>(depth_um.size()));
}

/// A frame in the middle of the time for which a press is held.
std::uint64_t held(const hal::sim::Scene& scene, const hal::sim::Press& press) {
  const double middle = 0.5 * (press.keys.at(1).time_s + press.keys.at(2).time_s);
  return static_cast<std::uint64_t>(std::lround(middle * scene.camera.fps));
}

void judge(std::uint64_t seed, const hal::sim::Scene& undeformed,
           const std::shared_ptr<const hal::sim::Truth>& objects, const table::Protocol& protocol,
           std::vector<ObjectErrors>& errors) {
  const table::Configuration& light = table::configurations()[0];
  const table::Trial trial = table::draw(seed, protocol);
  table::Sensor sensor(table::solve(undeformed, trial.all()), light, seed);
  const table::Material material = table::gather(sensor, trial, light.regression_centre);
  table::Sensor tested(objects, light, seed + 1000);
  const auto& presses = objects->scene().presses;
  for (std::size_t m = 0; m < errors.size(); ++m) {
    const table::Method& method = table::methods()[m];
    if (method.of_many && trial.many.empty()) continue;
    std::shared_ptr<const recon::Model> model;
    try {
      model = method.calibrate(material);
    } catch (const calibration::ModelRefused&) {
      ++errors[m].refused;
      continue;
    }
    calibration::DepthReader reader(model, method.sharpen_steps);
    for (std::size_t i = 0; i < presses.size(); ++i) {
      const std::uint64_t sequence = held(objects->scene(), presses[i]);
      const table::TruePress truth = table::true_press(*objects, sequence);
      errors[m].in_contact_mm[i].push_back(
          table::against_indentation(reader.read(tested.frame(sequence)), truth).mean_mm());
    }
    errors[m].no_contact_mm.push_back(rms_mm(reader.read(tested.frame(0))));
  }
}

}  // namespace

double ObjectErrors::object_mm(std::size_t object) const { return mean(in_contact_mm.at(object)); }

double ObjectErrors::mean_mm() const {
  double sum = 0;
  for (std::size_t i = 0; i < in_contact_mm.size(); ++i) sum += object_mm(i);
  return sum / static_cast<double>(in_contact_mm.size());
}

std::vector<std::string> object_names() {
  std::vector<std::string> names;
  for (const hal::sim::Press& press : all_objects().presses) names.push_back(press.object.kind);
  return names;
}

std::vector<ObjectErrors> read_objects(int seeds, table::Law law, const table::Protocol& protocol) {
  const auto objects = std::make_shared<const hal::sim::Truth>(all_objects(law));
  const hal::sim::Scene undeformed =
      law == table::Law::built_in ? hal::sim::default_scene() : table::another_law();
  std::vector<ObjectErrors> errors(table::methods().size());
  for (ObjectErrors& each : errors) each.in_contact_mm.resize(objects->scene().presses.size());
  for (int seed = 1; seed <= seeds; ++seed) {
    judge(static_cast<std::uint64_t>(seed), undeformed, objects, protocol, errors);
  }
  return errors;
}

std::string to_markdown(const std::vector<ObjectErrors>& errors, int seeds,
                        const std::string& sensor) {
  std::string out = "| mean absolute error in contact, mm |";
  std::string rule = "\n| --- |";
  for (const table::Method& method : table::methods()) {
    out += fmt::format(" {} |", method.name);
    rule += " --- |";
  }
  out += rule;
  const auto row = [&](const std::string& name, const auto& value) {
    out += fmt::format("\n| {} |", name);
    for (const ObjectErrors& each : errors) out += fmt::format(" {:.3f} |", value(each));
  };
  const std::vector<std::string> names = object_names();
  for (std::size_t i = 0; i < names.size(); ++i) {
    row(names[i], [i](const ObjectErrors& each) { return each.object_mm(i); });
  }
  row("mean over all objects", [](const ObjectErrors& each) { return each.mean_mm(); });
  row("no contact, root mean square",
      [](const ObjectErrors& each) { return mean(each.no_contact_mm); });
  const auto refused = [](int sum, const ObjectErrors& each) { return sum + each.refused; };
  return out + fmt::format(
                   "\n\nMeans over {} seeds; {} presses were refused by the model. One frame each. "
                   "Simulated sensor, {}.\n",
                   seeds, std::accumulate(errors.begin(), errors.end(), 0, refused), sensor);
}

}  // namespace dtact::model_study
