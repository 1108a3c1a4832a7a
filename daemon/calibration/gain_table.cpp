#include "daemon/calibration/gain_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace dtact::calibration {
namespace {

std::string shape_text(const recon::SpatialGain& gain) {
  switch (gain.shape) {
    case recon::GainShape::none:
      break;
    case recon::GainShape::uniform:
      return "[gain]  # darkening counts as a share of the light at its place\nshape = "
             "\"uniform\"\n";
    case recon::GainShape::radial:
      return fmt::format(
          "[gain]  # darkening is multiplied by 1 + per_mm * distance from the centre\n"
          "shape = \"radial\"\ncentre_x_mm = {}\ncentre_y_mm = {}\nper_mm = {}\n",
          gain.centre_x_mm, gain.centre_y_mm, gain.per_mm);
  }
  return "[gain]  # the same at every place\nshape = \"none\"\n";
}

}  // namespace

std::string format_gain(const recon::SpatialGain& gain) {
  std::string text = shape_text(gain);
  if (!gain.polynomial.empty()) {
    text += fmt::format(
        "# and by 1 + the sum of these times x, y, x^2, xy, y^2, mm\n"
        "polynomial = [{}]\n",
        fmt::join(gain.polynomial, ", "));
  }
  return text + "\n";
}

recon::SpatialGain read_gain(tomlfile::KeyReader reader) {
  recon::SpatialGain gain;
  if (reader.keys().empty()) return gain;
  const std::string shape = reader.text("shape");
  if (shape == "radial") {
    gain = {.shape = recon::GainShape::radial,
            .centre_x_mm = reader.number("centre_x_mm", -1000, 1000),
            .centre_y_mm = reader.number("centre_y_mm", -1000, 1000),
            .per_mm = reader.number("per_mm", -1, 1)};
  } else if (shape == "uniform") {
    gain.shape = recon::GainShape::uniform;
  } else if (shape != "none") {
    reader.fail("shape",
                "\"" + shape + "\" is not allowed; expected \"none\", \"uniform\" or \"radial\"");
  }
  if (reader.has("polynomial")) {
    gain.polynomial = reader.numbers("polynomial", -1, 1);
    if (gain.polynomial.size() != 2 && gain.polynomial.size() != 5) {
      reader.fail("polynomial", "expected two numbers (a plane) or five (a quadratic)");
    }
  }
  reader.finish();
  return gain;
}

}  // namespace dtact::calibration
