#include "daemon/calibration/lut_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "daemon/calibration/tables.hpp"

namespace dtact::calibration {
namespace {

using tomlfile::KeyReader;
using Uncertainty = recon::Model::Uncertainty;

void read_lut(KeyReader& reader, bool monotone, recon::DepthLut& out) {
  constexpr int kFarthestQ6 = 255 * recon::kEntriesPerLevel;
  const auto level = [&reader](const char* key) {
    return static_cast<int>(reader.integer(key, -kFarthestQ6, kFarthestQ6));
  };
  out.first_q6 = level("first_q6");
  out.covered_from_q6 = level("covered_from_q6");
  out.covered_to_q6 = level("covered_to_q6");
  for (const std::int64_t um : reader.integers("um", -16383, 16383)) {
    out.um.push_back(static_cast<std::int16_t>(um));
  }
  try {
    recon::check(out, monotone);
  } catch (const std::invalid_argument& e) {
    reader.fail("", e.what());
  }
}

void read_uncertainty(KeyReader& reader, std::vector<Uncertainty>& out) {
  const std::vector<double> depths = reader.numbers("depth_mm", 0, 16.383);
  const std::vector<double> errors = reader.numbers("error_um", 0, 16383);
  if (depths.size() != errors.size()) reader.fail("error_um", "expected one for each depth_mm");
  if (!std::ranges::is_sorted(depths)) reader.fail("depth_mm", "expected ascending values");
  for (std::size_t i = 0; i < depths.size(); ++i) out.push_back({depths[i], errors[i]});
}

recon::Scattering read_scattering(KeyReader reader) {
  recon::Scattering scattering;
  scattering.narrow_mm = reader.number("narrow_mm", recon::kNarrowestMm, recon::kWidestNarrowMm);
  scattering.wide_mm = reader.number("wide_mm", recon::kNarrowestMm, recon::kWidestMm);
  scattering.narrow_weight = reader.number("narrow_weight", 0, 1);
  if (scattering.wide_mm <= scattering.narrow_mm) {
    reader.fail("wide_mm", "must be above narrow_mm; exchange the two and their weight");
  }
  reader.finish();
  return scattering;
}

void read_sharpened(KeyReader& top, recon::Model& model) {
  for (KeyReader& reader : top.tables("sharpened")) {
    if (model.method != recon::Method::lut) {
      reader.fail("", "method \"published\" has no sharpened LUTs; remove the table");
    }
    if (!model.scattering) {
      reader.fail("",
                  "needs the table [scattering] that its levels were sharpened by; "
                  "calibrate again or remove this table");
    }
    recon::Model::Sharpened sharpened;
    sharpened.steps = static_cast<int>(reader.integer("steps", 1, recon::kMaxSharpeningSteps));
    if (!model.sharpened.empty() && sharpened.steps <= model.sharpened.back().steps) {
      reader.fail("steps", "expected more than in the table before, which has " +
                               std::to_string(model.sharpened.back().steps));
    }
    read_lut(reader, true, sharpened.lut);
    if (reader.has("depth_mm") || reader.has("error_um")) {
      read_uncertainty(reader, sharpened.uncertainty);
    }
    reader.finish();
    model.sharpened.push_back(std::move(sharpened));
  }
}

std::string lut_text(const recon::DepthLut& lut) {
  return fmt::format("first_q6 = {}\ncovered_from_q6 = {}\ncovered_to_q6 = {}\num = {}\n",
                     lut.first_q6, lut.covered_from_q6, lut.covered_to_q6, array_text(lut.um));
}

std::vector<double> column(const std::vector<Uncertainty>& rows, double Uncertainty::* field) {
  std::vector<double> values;
  values.reserve(rows.size());
  for (const auto& row : rows) values.push_back(row.*field);
  return values;
}

std::string uncertainty_text(const std::vector<Uncertainty>& rows) {
  return fmt::format("depth_mm = {}\nerror_um = {}\n",
                     array_text(column(rows, &Uncertainty::depth_mm)),
                     array_text(column(rows, &Uncertainty::error_um)));
}

}  // namespace

void read_luts(KeyReader& top, recon::Model& model) {
  KeyReader lut = top.table("lut");
  read_lut(lut, model.method == recon::Method::lut, model.lut);
  lut.finish();
  if (top.has("uncertainty")) {
    KeyReader uncertainty = top.table("uncertainty");
    read_uncertainty(uncertainty, model.uncertainty);
    uncertainty.finish();
  }
  if (top.has("scattering")) model.scattering = read_scattering(top.table("scattering"));
  read_sharpened(top, model);
}

std::string format_luts(const recon::Model& model) {
  std::string t;
  if (!model.uncertainty.empty()) {
    t += "[uncertainty]  # of the LUT: mean absolute error in micrometres at some indentations\n";
    t += uncertainty_text(model.uncertainty) + "\n";
  }
  if (model.scattering) {
    t += fmt::format(
        "[scattering]  # sideways in the gel: two Gaussians' standard deviations, the share of\n"
        "# the narrow one; what levels are sharpened by\n"
        "narrow_mm = {}\nwide_mm = {}\nnarrow_weight = {}\n\n",
        model.scattering->narrow_mm, model.scattering->wide_mm, model.scattering->narrow_weight);
  }
  t += "# Indentation in micrometres, positive = pressed, of the darkening first_q6/64 "
       "grey levels and\n# on, 64 entries a level. Covered: what the calibration "
       "vouches for.\n[lut]\n" +
       lut_text(model.lut);
  for (const recon::Model::Sharpened& sharpened : model.sharpened) {
    t += fmt::format("\n[[sharpened]]  # the same for levels sharpened so often\nsteps = {}\n",
                     sharpened.steps);
    t += lut_text(sharpened.lut);
    if (!sharpened.uncertainty.empty()) t += uncertainty_text(sharpened.uncertainty);
  }
  return t;
}

}  // namespace dtact::calibration
