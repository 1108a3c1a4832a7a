#include "daemon/calibration/tables.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/recon/surface.hpp"

namespace dtact::calibration {
namespace {

std::string shape_text(const recon::FlatFieldGain& gain) {
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

using tomlfile::KeyReader;

constexpr double kMax = 1e6;  // of anything here: only not finite numbers are impossible

std::string estimate_text(const char* key, const GelEstimate::Estimate& estimate) {
  return fmt::format("{} = [{}, {}]\n", key, estimate.value, estimate.error);
}

GelEstimate::Estimate read_estimate(KeyReader& reader, const char* key) {
  const std::vector<double> pair = reader.numbers(key, 0, kMax);
  if (pair.size() != 2) reader.fail(key, "expected a number and its standard error");
  return {pair[0], pair[1]};
}

std::vector<double> read_five(KeyReader& reader, const char* key, double least) {
  std::vector<double> five = reader.numbers(key, least, kMax);
  if (five.size() != std::tuple_size_v<decltype(GelEstimate::slope)>) {
    reader.fail(key, "expected five numbers");
  }
  return five;
}

using Kind = recon::Surface::Kind;
using Limits = recon::SurfaceLimits;

/// As HeightSource numbers them.
constexpr std::array<std::string_view, 5> kHeightSources = {"unknown", "assumed", "board",
                                                            "drawing", "presses"};

std::string format_shape(const recon::Surface& surface) {
  if (surface.kind == Kind::sphere) {
    return fmt::format("shape = \"sphere\"\nradius_mm = {}\n", surface.radius_mm);
  }
  return fmt::format(
      "shape = \"cylinder\"\nradius_mm = {}\n"
      "axis_deg = {}  # from the map's x towards its y\n",
      surface.radius_mm, surface.axis_deg);
}

}  // namespace

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

std::string format_gain(const recon::FlatFieldGain& gain) {
  std::string text = shape_text(gain);
  if (!gain.polynomial.empty()) {
    text += fmt::format(
        "# and by 1 + the sum of these times x, y, x^2, xy, y^2, mm\n"
        "polynomial = [{}]\n",
        fmt::join(gain.polynomial, ", "));
  }
  return text + "\n";
}

recon::FlatFieldGain read_gain(tomlfile::KeyReader reader) {
  recon::FlatFieldGain gain;
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

std::string format_gel(const GelEstimate& gel) {
  std::array<double, 5> slopes{};
  std::array<double, 5> errors{};
  for (std::size_t i = 0; i < slopes.size(); ++i) {
    slopes[i] = gel.slope[i].value;
    errors[i] = gel.slope[i].error;
  }
  return "[gel]  # as fitted to the presses, for people and simulators: a number and its "
         "standard "
         "error\n" +
         estimate_text("thickness_mm", gel.thickness_mm) +
         estimate_text("narrow_mm", gel.narrow_mm) + estimate_text("wide_mm", gel.wide_mm) +
         estimate_text("narrow_weight", gel.narrow_weight) +
         fmt::format(
             "# Share of the light that is lost for each thickness indented, at some "
             "indentations over\n# the thickness; times the factor where it bulges.\n"
             "indentation = [{}]\nslope = [{}]\nslope_error = [{}]\nbulge_factor = {}\n"
             "residual_levels = {}\n\n",
             fmt::join(gel.indentation, ", "), fmt::join(slopes, ", "), fmt::join(errors, ", "),
             gel.bulge_factor, gel.residual_levels);
}

GelEstimate read_gel(KeyReader reader) {
  GelEstimate gel;
  gel.thickness_mm = read_estimate(reader, "thickness_mm");
  gel.narrow_mm = read_estimate(reader, "narrow_mm");
  gel.wide_mm = read_estimate(reader, "wide_mm");
  gel.narrow_weight = read_estimate(reader, "narrow_weight");
  const std::vector<double> indentation = read_five(reader, "indentation", -kMax);
  const std::vector<double> slopes = read_five(reader, "slope", 0);
  const std::vector<double> errors = read_five(reader, "slope_error", 0);
  for (std::size_t i = 0; i < gel.slope.size(); ++i) {
    gel.indentation[i] = indentation[i];
    gel.slope[i] = {slopes[i], errors[i]};
  }
  gel.bulge_factor = reader.number("bulge_factor", 0, kMax);
  gel.residual_levels = reader.number("residual_levels", 0, kMax);
  reader.finish();
  return gel;
}

std::string format_view(const CameraView& view) {
  if (view.source == HeightSource::unknown) return {};
  const bool levels = view.per_mm == 0;
  return fmt::format(
      "[viewpoint]  # of the camera: a point pressed in by d is at x - (x - foot) * d * per_mm\n"
      "foot = [{}, {}]  # of the camera's axis on the surface, mm\n"
      "source = \"{}\"\n"
      "{} = {}  # {}\n"
      "error = {}  # standard error of it; 0: not known\n\n",
      view.foot_mm.x, view.foot_mm.y, kHeightSources[static_cast<std::size_t>(view.source)],
      levels ? "per_level" : "per_mm", levels ? view.per_level : view.per_mm,
      levels ? "1 / height, for each grey level that a LUT turns into millimetres"
             : "1 / height above the surface",
      view.error);
}

CameraView read_view(KeyReader reader) {
  CameraView view;
  if (reader.keys().empty()) return view;
  const std::vector<double> foot = reader.numbers("foot", -Limits::kMaxFootMm, Limits::kMaxFootMm);
  if (foot.size() != 2) reader.fail("foot", "expected x and y");
  view.foot_mm = {foot[0], foot[1]};
  const std::string source = reader.text("source");
  const auto known = std::ranges::find(kHeightSources, source);
  if (known == kHeightSources.end() || known == kHeightSources.begin()) {
    reader.fail("source", "\"" + source +
                              "\" is not allowed; expected \"assumed\", \"board\", \"drawing\" or "
                              "\"presses\"");
  }
  view.source = static_cast<HeightSource>(known - kHeightSources.begin());
  if (reader.has("per_level")) {
    view.per_level = reader.number("per_level", 0, Limits::kMaxPerMm);
  } else {
    view.per_mm = reader.number("per_mm", 0, Limits::kMaxPerMm);
  }
  view.error = reader.number("error", 0, 1);
  reader.finish();
  return view;
}

std::string format_surface(const recon::Surface& surface) {
  if (surface.kind == Kind::plane) return {};
  return fmt::format(
      "{}air_mm = {}  # from the camera's pinhole to the gel's flat back\n"
      "gel_mm = {}  # from there to the surface\n"
      "refraction = {}  # of the gel\n",
      format_shape(surface), surface.air_mm, surface.gel_mm, surface.refraction);
}

recon::Surface read_surface(tomlfile::KeyReader reader) {
  recon::Surface surface;
  if (reader.keys().empty()) return surface;
  const std::string shape = reader.text("shape");
  if (shape == "sphere") {
    surface.kind = Kind::sphere;
  } else if (shape == "cylinder") {
    surface.kind = Kind::cylinder;
  } else {
    reader.fail("shape", "\"" + shape + "\" is not allowed; expected \"sphere\" or \"cylinder\"");
  }
  surface.radius_mm = reader.number("radius_mm", Limits::kMinRadiusMm, Limits::kMaxRadiusMm);
  if (surface.kind == Kind::cylinder) surface.axis_deg = reader.number("axis_deg", -180, 180);
  surface.air_mm = reader.number("air_mm", Limits::kMinDistanceMm, Limits::kMaxDistanceMm);
  surface.gel_mm = reader.number("gel_mm", Limits::kMinDistanceMm, Limits::kMaxDistanceMm);
  surface.refraction = reader.number("refraction", 1, Limits::kMaxRefraction);
  reader.finish();
  return surface;
}

}  // namespace dtact::calibration
