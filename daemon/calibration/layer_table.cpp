#include "daemon/calibration/layer_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cstddef>
#include <tuple>
#include <vector>

namespace dtact::calibration {
namespace {

using tomlfile::KeyReader;

constexpr double kMost = 1e6;  // of anything here: only not finite numbers are impossible

std::string estimate_text(const char* key, const Layer::Estimate& estimate) {
  return fmt::format("{} = [{}, {}]\n", key, estimate.value, estimate.error);
}

Layer::Estimate read_estimate(KeyReader& reader, const char* key) {
  const std::vector<double> pair = reader.numbers(key, 0, kMost);
  if (pair.size() != 2) reader.fail(key, "expected a number and its standard error");
  return {pair[0], pair[1]};
}

std::vector<double> read_five(KeyReader& reader, const char* key, double least) {
  std::vector<double> five = reader.numbers(key, least, kMost);
  if (five.size() != std::tuple_size_v<decltype(Layer::slope)>) {
    reader.fail(key, "expected five numbers");
  }
  return five;
}

}  // namespace

std::string format_layer(const Layer& layer) {
  std::array<double, 5> slopes{};
  std::array<double, 5> errors{};
  for (std::size_t i = 0; i < slopes.size(); ++i) {
    slopes[i] = layer.slope[i].value;
    errors[i] = layer.slope[i].error;
  }
  return "[layer]  # as fitted to the presses, for people and simulators: a number and its "
         "standard "
         "error\n" +
         estimate_text("thickness_mm", layer.thickness_mm) +
         estimate_text("narrow_mm", layer.narrow_mm) + estimate_text("wide_mm", layer.wide_mm) +
         estimate_text("narrow_weight", layer.narrow_weight) +
         fmt::format(
             "# Share of the light that is lost for each thickness indented, at some "
             "indentations over\n# the thickness; times the factor where it bulges.\n"
             "indentation = [{}]\nslope = [{}]\nslope_error = [{}]\nbulge_factor = {}\n"
             "residual_levels = {}\n\n",
             fmt::join(layer.indentation, ", "), fmt::join(slopes, ", "), fmt::join(errors, ", "),
             layer.bulge_factor, layer.residual_levels);
}

Layer read_layer(KeyReader reader) {
  Layer layer;
  layer.thickness_mm = read_estimate(reader, "thickness_mm");
  layer.narrow_mm = read_estimate(reader, "narrow_mm");
  layer.wide_mm = read_estimate(reader, "wide_mm");
  layer.narrow_weight = read_estimate(reader, "narrow_weight");
  const std::vector<double> indentation = read_five(reader, "indentation", -kMost);
  const std::vector<double> slopes = read_five(reader, "slope", 0);
  const std::vector<double> errors = read_five(reader, "slope_error", 0);
  for (std::size_t i = 0; i < layer.slope.size(); ++i) {
    layer.indentation[i] = indentation[i];
    layer.slope[i] = {slopes[i], errors[i]};
  }
  layer.bulge_factor = reader.number("bulge_factor", 0, kMost);
  layer.residual_levels = reader.number("residual_levels", 0, kMost);
  reader.finish();
  return layer;
}

}  // namespace dtact::calibration
