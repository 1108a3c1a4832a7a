#include "tests/accuracy/table/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <set>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/model/model_fit.hpp"
#include "hal/sim/scene.hpp"
#include "tests/accuracy/table/another_law.hpp"
#include "tests/accuracy/table/methods.hpp"

namespace dtact::table {
namespace {

// A judged test press: one frame, decoded like in the daemon.
struct Test {
  image::Grey8 frame;
  calibration::Circle circle;
  double radius_mm = 0;
};

std::vector<Test> photograph(Sensor& sensor, const Trial& trial, const image::Grey8& reference) {
  std::vector<Test> tests;
  for (std::size_t i = 0; i < trial.tests.size(); ++i) {
    const auto frames = sensor.press(1 + trial.many.size() + i, 1);
    tests.push_back({frames[0], calibration::published_circle(reference, crop8(mean_q8(frames))),
                     trial.tests[i].radius_mm});
  }
  return tests;
}

// The least, mean and greatest over seeds of `value` of the cells of one place.
struct Spread {
  double mean = 0;
  double least = INFINITY;
  double greatest = -INFINITY;
  int count = 0;
};

template <typename Value>
Spread spread(const std::vector<Cell>& cells, std::size_t configuration, std::size_t method,
              Law law, const Value& value) {
  Spread spread;
  for (const Cell& cell : cells) {
    if (cell.configuration != configuration || cell.method != method || cell.law != law) continue;
    const double v = value(cell);
    spread.mean += v;
    spread.least = std::min(spread.least, v);
    spread.greatest = std::max(spread.greatest, v);
    ++spread.count;
  }
  spread.mean /= spread.count;
  return spread;
}

template <typename Value>
void add_rows(std::string& out, const std::vector<Cell>& cells, std::size_t columns, int seeds,
              Law law, const char* truth, const Value& value) {
  for (std::size_t m = 0; m < methods().size(); ++m) {
    out += fmt::format("| {}, {} |", methods()[m].name, truth);
    for (std::size_t c = 0; c < columns; ++c) {
      const Spread s = spread(cells, c, m, law, value);
      if (s.count == 0) {
        out += " – |";
        continue;
      }
      out += fmt::format(" {:.4f} ({:.4f}–{:.4f}", s.mean, s.least, s.greatest);
      out += s.count == seeds ? ") |" : fmt::format("; {} refused) |", seeds - s.count);
    }
    out += '\n';
  }
}

}  // namespace

std::vector<Cell> run_trial(const Trial& trial, std::size_t configuration_count, Law law) {
  const auto truth =
      solve(law == Law::built_in ? hal::sim::default_scene() : another_law(), trial.all());
  std::vector<TruePress> indentations;
  for (std::size_t i = 0; i < trial.tests.size(); ++i) {
    indentations.push_back(
        true_press(*truth, first_still_frame(*truth, 1 + trial.many.size() + i)));
  }
  std::vector<Cell> cells;
  for (std::size_t c = 0; c < configuration_count; ++c) {
    Sensor sensor(truth, configurations()[c], trial.seed);
    const Material material = gather(sensor, trial, configurations()[c].regression_centre);
    const auto tests = photograph(sensor, trial, crop8(material.reference_q8));
    for (std::size_t m = 0; m < methods().size(); ++m) {
      if (methods()[m].of_many && trial.many.empty()) continue;
      std::shared_ptr<const recon::Model> model;
      try {
        model = methods()[m].calibrate(material);
      } catch (const calibration::ModelRefused&) {
        continue;  // no calibration is no error of depth; the table counts them
      }
      calibration::DepthReader reader(model, methods()[m].sharpen_steps);
      Cell cell{trial.seed, c, m, law, {}, {}};
      for (std::size_t t = 0; t < tests.size(); ++t) {
        const auto depth = reader.read(tests[t].frame);
        cell.circle += against_circle(depth, tests[t].circle, tests[t].radius_mm);
        cell.indentation += against_indentation(depth, indentations[t]);
      }
      cells.push_back(cell);
    }
  }
  return cells;
}

std::string to_csv(const std::vector<Cell>& cells) {
  std::string out =
      "seed,configuration,method,circle_mae_mm,circle_untrusted,indentation_mae_mm,"
      "indentation_untrusted,law\n";
  const auto share = [](const Error& e) {
    return static_cast<double>(e.untrusted) / static_cast<double>(e.untrusted + e.pixels);
  };
  for (const Cell& cell : cells) {
    fmt::format_to(std::back_inserter(out), "{},{},\"{}\",{:.5f},{:.5f},{:.5f},{:.5f},{}\n",
                   cell.seed, configurations()[cell.configuration].name,
                   methods()[cell.method].name, cell.circle.mean_mm(), share(cell.circle),
                   cell.indentation.mean_mm(), share(cell.indentation),
                   cell.law == Law::built_in ? "built-in" : "another");
  }
  return out;
}

std::string to_markdown(const std::vector<Cell>& cells) {
  std::set<std::uint64_t> seeds;
  std::size_t columns = 0;
  for (const Cell& cell : cells) {
    seeds.insert(cell.seed);
    columns = std::max(columns, cell.configuration + 1);
  }
  std::string out = "| mean absolute error, mm |";
  std::string rule = "| --- |";
  std::string deviation = "| reference image's standard deviation, grey levels |";
  std::string single = "| the paper: single image (real sensor) |";
  std::string regression = "| the paper: linear regression (real sensor) |";
  for (std::size_t c = 0; c < columns; ++c) {
    const Configuration& configuration = configurations()[c];
    out += fmt::format(" {} |", configuration.name);
    rule += " --- |";
    deviation += fmt::format(" {:.2f} |", reference_deviation(configuration));
    const auto& paper = configuration.published;
    single += paper ? fmt::format(" {:.4f} |", paper->single_mm) : " – |";
    regression += paper ? fmt::format(" {:.4f} |", paper->regression_mm) : " – |";
  }
  out += '\n' + rule + '\n' + deviation + '\n' + single + '\n' + regression + '\n';
  const auto count = static_cast<int>(seeds.size());
  add_rows(out, cells, columns, count, Law::built_in, "circle truth",
           [](const Cell& cell) { return cell.circle.mean_mm(); });
  const auto indentation = [](const Cell& cell) { return cell.indentation.mean_mm(); };
  add_rows(out, cells, columns, count, Law::built_in, "true indentation", indentation);
  add_rows(out, cells, columns, count, Law::another, "true indentation, another law", indentation);
  out += fmt::format(
      "\nMeans over {} seeds, least and greatest seed in brackets. Simulated sensor, "
      "apart from the paper's two rows.\n",
      seeds.size());
  return out;
}

}  // namespace dtact::table
