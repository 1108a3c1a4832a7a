#include "clients/calibrate/force/force_command.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/calibrate/force/force_fit.hpp"
#include "clients/calibrate/force/force_pairs.hpp"
#include "clients/calibrate/offline/images.hpp"
#include "clients/common/json.hpp"
#include "clients/common/program.hpp"
#include "clients/common/reports.pb.h"
#include "daemon/calibration/calibration.hpp"

namespace dtact::force {
namespace {

constexpr double kNewtonsPerGram = 0.00980665;  // standard gravity

struct Options {
  std::string calibration;
  std::vector<std::string> reference;
  std::vector<std::string> pairs;
  std::string csv;
  std::optional<double> thickness_mm;
  bool grams = false;
  std::string output;
};

std::vector<Pair> measured(const Options& options, const calibration::Calibration& calibration) {
  std::vector<Reading> readings;
  readings.reserve(options.pairs.size());
  for (const std::string& text : options.pairs) readings.push_back(parse_reading(text));
  if (!options.csv.empty()) {
    for (Reading& reading : read_readings(options.csv)) readings.push_back(std::move(reading));
  }
  std::vector<std::uint16_t> reference = calibration.model->reference_q8;
  if (!options.reference.empty()) {
    reference = ctl::load_images(options.reference, "--reference").mean_q8().pixels;
    if (reference.size() != calibration.model->reference_q8.size()) {
      throw std::runtime_error("--reference has not the size of the calibration's frame");
    }
  }
  const ContactReader reader(calibration, reference, options.calibration);
  std::vector<Pair> pairs;
  for (const Reading& reading : readings) {
    pairs.push_back(reader.measure(reading.frames));
    pairs.back().newtons = options.grams ? reading.value * kNewtonsPerGram : reading.value;
  }
  return pairs;
}

void report(const Fit& fit, const std::vector<Pair>& pairs, const std::string& output,
            cli::Context& context) {
  const recon::ForceModel& model = fit.model;
  if (context.json) {
    cli::ForceReport report;
    report.set_output(output);
    report.set_modulus_mpa(model.modulus_mpa);
    report.set_thickness_mm(model.thickness_mm);
    report.set_zero_mm(model.zero_mm);
    report.set_error_share(model.error_share);
    report.set_from_n(model.from_n);
    report.set_to_n(model.to_n);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      cli::ForcePair& pair = *report.add_pairs();
      pair.set_name(pairs[i].name);
      pair.set_newtons(pairs[i].newtons);
      pair.set_left_out_error_n(fit.left_out[i]);
    }
    context.out << cli::json_line(report);
    return;
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    context.out << fmt::format("{}: {:.3f} N; left out, missed by {:+.3f} N\n", pairs[i].name,
                               pairs[i].newtons, fit.left_out[i]);
  }
  context.out << fmt::format(
      "force: Young's modulus {:.3f} MPa of a gel {:.2f} mm thick; pairs left out are missed by "
      "{:.1f} %, {} pairs of {:.2f} to {:.2f} N; in {}\n",
      model.modulus_mpa, model.thickness_mm, 100 * model.error_share, model.pairs, model.from_n,
      model.to_n, output);
}

void run(const Options& options, cli::Context& context) {
  calibration::Calibration calibration = calibration::load(options.calibration);
  const std::vector<Pair> pairs = measured(options, calibration);
  std::optional<double> thickness_mm = options.thickness_mm;
  if (!thickness_mm && calibration.gel) thickness_mm = calibration.gel->thickness_mm.value;
  constexpr double kThinnestMm = 0.5;
  constexpr double kThickestMm = 5;
  if (thickness_mm && !(*thickness_mm >= kThinnestMm && *thickness_mm <= kThickestMm)) {
    throw std::runtime_error(
        fmt::format("{}: its gel is {:.2f} mm thick; force is calibrated for {} to {} mm: give "
                    "--thickness-mm",
                    options.calibration, *thickness_mm, kThinnestMm, kThickestMm));
  }
  const Fit fit = fit_force(pairs, thickness_mm);
  auto model = std::make_shared<recon::Model>(*calibration.model);
  model->force = fit.model;
  calibration.model = std::move(model);
  const std::string output = options.output.empty() ? options.calibration : options.output;
  calibration::save(calibration, output);
  report(fit, pairs, output, context);
}

}  // namespace

void add_force(CLI::App& app, cli::Context& context) {
  CLI::App* force = app.add_subcommand(
      "force",
      "Calibrate the normal force: the gel's Young's modulus, fitted to readings of a scale");
  const auto options = std::make_shared<Options>();
  force->add_option("--calibration", options->calibration, "Calibration folder")
      ->type_name("FOLDER")
      ->required();
  force
      ->add_option("--pair", options->pairs,
                   "Frames and the scale's reading in newtons: press.png@0.52, FOLDER@0.52 (the "
                   "mean of its PNG files), or a recording of the daemon with this calibration: "
                   "press.mcap@0.52, press.mcap:120:180@0.52 for its frames 120 to 179")
      ->type_name("FRAMES@N");
  force
      ->add_option("--pairs", options->csv,
                   "CSV file of such pairs with the heading frames,force; frames are relative to "
                   "its folder")
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
  force->add_flag("--grams", options->grams, "Readings are in grams, as kitchen scales show them");
  force
      ->add_option("--reference", options->reference,
                   "Undeformed surface of the PNG files, in the same light: PNG files, or a folder "
                   "of them (averaged); left out: the calibration's")
      ->type_name("FILE");
  force
      ->add_option(
          "--thickness-mm", options->thickness_mm,
          "Thickness of the gel, mm; left out: as the depth calibration found it, or fitted to "
          "the readings")
      ->check(cli::in_range(0.5, 5.0));
  force
      ->add_option("-o,--output", options->output,
                   "Calibration folder to write; left out: the same one")
      ->type_name("FOLDER");
  cli::add_json_option(*force, context);
  force->callback([&context, options] { run(*options, context); });
}

}  // namespace dtact::force
