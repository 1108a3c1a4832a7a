#include "clients/calibrate/fit/model/auto_build.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "clients/calibrate/fit/lut_fit.hpp"
#include "clients/calibrate/fit/model/model_build.hpp"

namespace dtact::calibration {
namespace {

double sure_mm(const SymmetricPress& press) { return kSureOfContact * press.contact.radius_mm; }

/// Mean of `value(level)` over the sure part of a press's contact.
template <typename Value>
double mean_of_sure(const SymmetricPress& press, const Value& value) {
  double sum = 0;
  double pixels = 0;
  for (int y = 0; y < press.map.height; ++y) {
    for (int x = 0; x < press.map.width; ++x) {
      const double level = press.map.at(x, y);
      const bool sure = distance_mm(press.map, press.contact, x, y) < sure_mm(press);
      if (!sure || std::isnan(level)) continue;
      sum += value(level);
      pixels += 1;
    }
  }
  return sum / pixels;
}

/// In multiples of the ball's radius; the profile reaches 2.25 (kFarField).
constexpr std::array<double, 2> kReaches = {1.5, 1.75};
/// Right, down, left, up.
constexpr std::array<std::pair<int, int>, 4> kSides = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

std::vector<PixelFilter> parts_of(const SymmetricPress& press) {
  const Contact& contact = press.contact;
  std::vector<PixelFilter> parts;
  parts.reserve(kSides.size() + kReaches.size());
  for (const auto& [right, down] : kSides) {
    parts.emplace_back([&contact, right, down](int x, int y) {
      return right * (x - contact.col) + down * (y - contact.row) > 0;
    });
  }
  for (const double reach : kReaches) {
    parts.emplace_back([&press, within_mm = reach * contact.ball_radius_mm](int x, int y) {
      return distance_mm(press.map, press.contact, x, y) < within_mm;
    });
  }
  return parts;
}

/// Limit of depth_spread_mm() for using the gel's depth, millimetres: simulated
/// sensors have 0.024 at most, one of another law 0.010; the two real presses 0.07 and 0.24.
constexpr double kMaxSpread = 0.03;

BallPress only_press(const BallPresses& set, const recon::FlatFieldGain& gain) {
  return {.reference_q8 = set.reference_q8,
          .frames = set.presses.front().frames,
          .ball_radius_mm = set.ball_radius_mm,
          .mm_per_px = set.mm_per_px,
          .lens = set.lens,
          .crop = set.crop,
          .view = set.view,
          .gain = gain,
          .may_share_light = !set.gain_specified,
          .depth_mm = set.presses.front().depth_mm};
}

/// A press seen with the calibration, without the gain that is the press's own.
SymmetricPress seen(const Calibration& calibration, const BallPresses& set,
                    const BallPresses::Press& press, const PressAsymmetry& gain) {
  const SettledPress settled =
      settle(*calibration.model, set.reference_q8.pixels, press.frames, set.ball_radius_mm);
  return without_asymmetry(settled.map, settled.contact, gain);
}

/// Spread of the deepest press to which a gel was fitted.
double spread_of(const FittedCalibration& fitted, const BallPresses& set) {
  const auto deepest = std::ranges::max_element(fitted.presses, {}, &PressReport::Depth::depth_mm);
  const auto press = std::ranges::find(set.presses, deepest->name, &BallPresses::Press::name);
  const auto index = static_cast<std::size_t>(deepest - fitted.presses.begin());
  const SymmetricPress levels =
      seen(fitted.calibration, set, *press, fitted.press_asymmetries[index].gain);
  const MapOptics optics{fitted.light_levels,
                         fitted.calibration.model->smoothing_px * set.mm_per_px, set.mm_per_px};
  return depth_spread_mm(levels, optics, fitted.fit);
}

/// Uncertainty of the gel's LUT, plus, in squares, the distance of the two LUTs at the depth.
std::vector<recon::Model::Uncertainty> uncertainty_of(const recon::DepthLut& constrained,
                                                      const GelLut& gel,
                                                      const recon::Model& of_gel) {
  std::vector<recon::Model::Uncertainty> rows = of_gel.uncertainty;
  for (recon::Model::Uncertainty& row : rows) {
    const auto depth_um = static_cast<std::int16_t>(std::lround(1000 * row.depth_mm));
    const auto found = std::ranges::lower_bound(constrained.um, depth_um);
    const auto at = std::min(found - constrained.um.begin(), std::ssize(constrained.um) - 1);
    const double level = static_cast<double>(constrained.first_q6 + at) / recon::kEntriesPerLevel;
    const double apart_um = 1000 * (lut_mm(constrained, level) - gel.read_mm(level));
    row.error_um = std::round(10 * std::hypot(row.error_um, apart_um)) / 10;
  }
  return rows;
}

void add_line(std::string& note, const std::string& line) {
  note += (note.empty() ? "" : "\n") + line;
}

/// "; the gel itself leaves 0.200 grey levels", and whether noise alone may cause that: a single
/// image's noise is more than explains() allows.
std::string left_by(const FittedCalibration& fitted, const BallPresses& set) {
  constexpr std::size_t kEnough = 10;  // images whose mean has too little noise to matter
  const bool few = std::ranges::any_of(
      set.presses, [](const BallPresses::Press& press) { return press.frames.size() < kEnough; });
  return fmt::format("; the gel itself leaves {:.3f} grey levels{}",
                     fitted.fit.residual * fitted.light_levels,
                     few ? fmt::format("; averages of at least {} images of the press and of the "
                                       "reference show whether that is more than their noise",
                                       kEnough)
                         : "");
}

Calibration constrained_to(const FittedCalibration& fitted, const BallPresses& set,
                           const recon::FlatFieldGain& gain, PressReport& report) {
  PressChoices choices;
  Calibration made = build(only_press(set, gain), &choices);
  report.note = choices.describe();
  const BallPresses::Press& press = set.presses.front();
  const SymmetricPress by_press = seen(made, set, press, choices.press_asymmetry.gain);
  const SymmetricPress by_gel =
      seen(fitted.calibration, set, press, fitted.press_asymmetries.front().gain);
  const recon::Model& of_gel = *fitted.calibration.model;
  const GelLut gel{&of_gel.lut, mean_level(by_gel) / mean_level(by_press)};
  auto model = std::make_shared<recon::Model>(*made.model);
  ConstrainedLut constrained = constrain(model->lut, gel, by_press);
  model->lut = std::move(constrained.lut);
  model->uncertainty = uncertainty_of(model->lut, gel, of_gel);
  made.model = std::move(model);
  made.gel = fitted.calibration.gel;
  add_line(report.note, fmt::format("LUT: what the press shows, at the depth of a gel, {:+.3f} mm "
                                    "from where the darkening's straight line ends{}",
                                    constrained.moved_mm, left_by(fitted, set)));
  return made;
}

Calibration chained_at(const FittedCalibration& fitted, const BallPresses& set,
                       PressReport& report) {
  BallPresses at_depths = set;
  for (const PressReport::Depth& used : fitted.presses) {
    const auto press = std::ranges::find(at_depths.presses, used.name, &BallPresses::Press::name);
    press->depth_mm = used.depth_mm;
  }
  // The presses to which the gel was not fitted are left out there, too, and named.
  Calibration made = build(at_depths, &report);
  add_line(report.note,
           "LUT: what the presses show, at the depths of a gel" + left_by(fitted, set));
  made.gel = fitted.calibration.gel;
  return made;
}

}  // namespace

double GelLut::read_mm(double level) const { return lut_mm(*lut, levels_per_level * level); }

double mean_level(const SymmetricPress& press) {
  return mean_of_sure(press, [](double level) { return level; });
}

ConstrainedLut constrain(const recon::DepthLut& lut, const GelLut& gel,
                         const SymmetricPress& press) {
  ConstrainedLut constrained{lut, mean_of_sure(press, [&](double level) {
                               return gel.read_mm(level) - lut_mm(lut, level);
                             })};
  const RadialProfile profile = radial_profile(press.map, press.contact, 2 * sure_mm(press));
  const double sure_level = std::max(1.0, profile.at(sure_mm(press)));
  const double last_level = static_cast<double>(lut.covered_to_q6) / recon::kEntriesPerLevel;
  const auto apart_mm = [&](double level) {
    return lut_mm(lut, level) + constrained.moved_mm - gel.read_mm(level);
  };
  double deepest_mm = -INFINITY;
  for (std::size_t i = 0; i < lut.um.size(); ++i) {
    const double level = static_cast<double>(lut.first_q6 + static_cast<int>(i)) /
                         static_cast<double>(recon::kEntriesPerLevel);
    const double share = std::clamp(level / sure_level, 0.0, 1.0);
    const double depth_mm =
        gel.read_mm(level) + share * apart_mm(std::clamp(level, sure_level, last_level));
    deepest_mm = std::max(deepest_mm, depth_mm);
    constrained.lut.um[i] = static_cast<std::int16_t>(std::lround(1000 * deepest_mm));
  }
  return constrained;
}

double depth_spread_mm(const SymmetricPress& press, const MapOptics& optics, const ModelFit& fit) {
  const double level = mean_level(press);
  const auto depth_mm = [&](const PixelFilter& use) {
    const PressProfile profile = profile_of(press, optics.light_levels, optics.smoothing_mm, use);
    const ModelFit part = fit_model(std::span(&profile, 1), fit);
    return lut_mm(luts_of(part.gel, optics, part.deepest_mm()).front(), level);
  };
  try {
    const double all_mm = depth_mm({});
    double max_mm = 0;
    for (const PixelFilter& part : parts_of(press)) {
      max_mm = std::max(max_mm, std::abs(depth_mm(part) - all_mm));
    }
    return max_mm;
  } catch (const ModelRefused&) {
    return std::numeric_limits<double>::infinity();
  }
}

Calibration build_from_sphere(const BallPresses& set, const recon::FlatFieldGain& gain,
                              PressReport& report) {
  if (set.presses.size() != 1) return build(set, &report);
  PressChoices choices;
  Calibration made = build(only_press(set, gain), &choices);
  report.note = choices.describe();
  return made;
}

Calibration build_auto(const BallPresses& set, const recon::FlatFieldGain& gain,
                       PressReport& report) {
  const bool measured = std::ranges::any_of(
      set.presses, [](const BallPresses::Press& press) { return press.depth_mm.has_value(); });
  if (measured) return build_from_sphere(set, gain, report);
  FittedCalibration fitted;
  try {
    fitted = build_model(set, gain);
  } catch (const std::runtime_error& e) {
    Calibration made = build_from_sphere(set, gain, report);
    add_line(report.note, fmt::format("LUT: what the presses show alone, since {}", e.what()));
    return made;
  }
  if (fitted.fit.explains()) {
    report.note = fitted.describe_press();
    add_line(report.note, "LUT: of a gel, which explains all but noise");
    report.left_out = std::move(fitted.left_out);
    report.presses = std::move(fitted.presses);
    return std::move(fitted.calibration);
  }
  if (const double spread_mm = spread_of(fitted, set); spread_mm > kMaxSpread) {
    Calibration made = build_from_sphere(set, gain, report);
    add_line(report.note,
             fmt::format("LUT: what the presses show alone: gels fitted to parts of a press's "
                         "picture put it {:.2f} mm deeper or shallower, and {:.2f} mm are allowed",
                         spread_mm, kMaxSpread));
    return made;
  }
  return set.presses.size() == 1 ? constrained_to(fitted, set, gain, report)
                                 : chained_at(fitted, set, report);
}

}  // namespace dtact::calibration
