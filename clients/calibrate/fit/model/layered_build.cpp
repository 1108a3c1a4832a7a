#include "clients/calibrate/fit/model/layered_build.hpp"

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

#include "clients/calibrate/fit/list_fit.hpp"
#include "clients/calibrate/fit/model/model_build.hpp"

namespace dtact::calibration {
namespace {

double sure_mm(const LevelledPress& press) { return kSureOfContact * press.contact.radius_mm; }

/// Mean of `value(level)` over the sure part of a press's contact.
template <typename Value>
double mean_of_sure(const LevelledPress& press, const Value& value) {
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

/// Of the ball's radius: the profile goes to 2.25 (kFarField).
constexpr std::array<double, 2> kReaches = {1.5, 1.75};
/// Right, down, left, up.
constexpr std::array<std::pair<int, int>, 4> kSides = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

std::vector<PixelFilter> parts_of(const LevelledPress& press) {
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

/// What depth_spread_mm() may be for a layer's depth to be taken from it, millimetres: simulated
/// sensors have 0.024 at most, one of another law 0.010; the two real presses 0.07 and 0.24.
constexpr double kMostSpread = 0.03;

BallPress only_press(const BallPresses& set, const recon::SpatialGain& gain) {
  return {.reference_q8 = set.reference_q8,
          .frames = set.presses.front().frames,
          .ball_radius_mm = set.ball_radius_mm,
          .mm_per_px = set.mm_per_px,
          .lens = set.lens,
          .crop = set.crop,
          .gain = gain,
          .may_share_light = !set.gain_told,
          .depth_mm = set.presses.front().depth_mm};
}

/// A press as a calibration sees it, without the gain that is the press's own.
LevelledPress seen(const Calibration& calibration, const BallPresses& set,
                   const BallPresses::Press& press, const PressGain& gain) {
  const SettledPress settled =
      settle(*calibration.model, set.reference_q8.pixels, press.frames, set.ball_radius_mm);
  return levelled(settled.map, settled.contact, gain);
}

/// Of the deepest of the presses that a layer was fitted to.
double spread_of(const FittedCalibration& fitted, const BallPresses& set) {
  const auto deepest = std::ranges::max_element(fitted.presses, {}, &PressReport::Depth::depth_mm);
  const auto press = std::ranges::find(set.presses, deepest->name, &BallPresses::Press::name);
  const auto index = static_cast<std::size_t>(deepest - fitted.presses.begin());
  const LevelledPress levels =
      seen(fitted.calibration, set, *press, fitted.press_gains[index].gain);
  const MapOptics optics{fitted.light_levels,
                         fitted.calibration.model->smoothing_px * set.mm_per_px, set.mm_per_px};
  return depth_spread_mm(levels, optics, fitted.fit);
}

/// Those of the layer, and in squares how far the two lists are apart at the depth.
std::vector<recon::Model::Uncertainty> uncertainty_of(const recon::DepthList& tied,
                                                      const LayerList& layer,
                                                      const recon::Model& of_layer) {
  std::vector<recon::Model::Uncertainty> rows = of_layer.uncertainty;
  for (recon::Model::Uncertainty& row : rows) {
    const auto depth_um = static_cast<std::int16_t>(std::lround(1000 * row.depth_mm));
    const auto found = std::ranges::lower_bound(tied.um, depth_um);
    const auto at = std::min(found - tied.um.begin(), std::ssize(tied.um) - 1);
    const double level = static_cast<double>(tied.first_q6 + at) / recon::kEntriesPerLevel;
    const double apart_um = 1000 * (look_up_mm(tied, level) - layer.read_mm(level));
    row.error_um = std::round(10 * std::hypot(row.error_um, apart_um)) / 10;
  }
  return rows;
}

void add_line(std::string& note, const std::string& line) {
  note += (note.empty() ? "" : "\n") + line;
}

/// "; the layer itself leaves 0.200 grey levels", and what that may be by noise alone: a single
/// image's is more than explains() allows.
std::string left_by(const FittedCalibration& fitted, const BallPresses& set) {
  constexpr std::size_t kEnough = 10;  // images whose mean has too little noise to matter
  const bool few = std::ranges::any_of(
      set.presses, [](const BallPresses::Press& press) { return press.frames.size() < kEnough; });
  return fmt::format(
      "; the layer itself leaves {:.3f} grey levels{}", fitted.fit.residual * fitted.light_levels,
      few ? fmt::format("; averages of {} images and more of the press, and of the untouched "
                        "surface, show whether that is more than their noise",
                        kEnough)
          : "");
}

Calibration tied_to(const FittedCalibration& fitted, const BallPresses& set,
                    const recon::SpatialGain& gain, PressReport& report) {
  PressChoices choices;
  Calibration made = build(only_press(set, gain), &choices);
  report.note = choices.describe();
  const BallPresses::Press& press = set.presses.front();
  const LevelledPress by_press = seen(made, set, press, choices.press_gain.gain);
  const LevelledPress by_layer =
      seen(fitted.calibration, set, press, fitted.press_gains.front().gain);
  const recon::Model& of_layer = *fitted.calibration.model;
  const LayerList layer{&of_layer.list, mean_level(by_layer) / mean_level(by_press)};
  auto model = std::make_shared<recon::Model>(*made.model);
  TiedList tied = tie(model->list, layer, by_press);
  model->list = std::move(tied.list);
  model->uncertainty = uncertainty_of(model->list, layer, of_layer);
  made.model = std::move(model);
  made.layer = fitted.calibration.layer;
  add_line(report.note,
           fmt::format("list: what the press shows, at the depth of a layer, {:+.3f} mm "
                       "from where the darkening's straight line ends{}",
                       tied.moved_mm, left_by(fitted, set)));
  return made;
}

Calibration chained_at(const FittedCalibration& fitted, const BallPresses& set,
                       PressReport& report) {
  BallPresses at_depths = set;
  for (const PressReport::Depth& used : fitted.presses) {
    const auto press = std::ranges::find(at_depths.presses, used.name, &BallPresses::Press::name);
    press->depth_mm = used.depth_mm;
  }
  // The presses that the layer was not fitted to are left out there, too, and named.
  Calibration made = build(at_depths, &report);
  add_line(report.note,
           "list: what the presses show, at the depths of a layer" + left_by(fitted, set));
  made.layer = fitted.calibration.layer;
  return made;
}

}  // namespace

double LayerList::read_mm(double level) const {
  return look_up_mm(*list, levels_per_level * level);
}

double mean_level(const LevelledPress& press) {
  return mean_of_sure(press, [](double level) { return level; });
}

TiedList tie(const recon::DepthList& list, const LayerList& layer, const LevelledPress& press) {
  TiedList tied{list, mean_of_sure(press, [&](double level) {
                  return layer.read_mm(level) - look_up_mm(list, level);
                })};
  const RadialProfile profile = radial_profile(press.map, press.contact, 2 * sure_mm(press));
  const double sure_level = std::max(1.0, profile.at(sure_mm(press)));
  const double last_level = static_cast<double>(list.covered_to_q6) / recon::kEntriesPerLevel;
  const auto apart_mm = [&](double level) {
    return look_up_mm(list, level) + tied.moved_mm - layer.read_mm(level);
  };
  double deepest_mm = -INFINITY;
  for (std::size_t i = 0; i < list.um.size(); ++i) {
    const double level = static_cast<double>(list.first_q6 + static_cast<int>(i)) /
                         static_cast<double>(recon::kEntriesPerLevel);
    const double share = std::clamp(level / sure_level, 0.0, 1.0);
    const double depth_mm =
        layer.read_mm(level) + share * apart_mm(std::clamp(level, sure_level, last_level));
    deepest_mm = std::max(deepest_mm, depth_mm);
    tied.list.um[i] = static_cast<std::int16_t>(std::lround(1000 * deepest_mm));
  }
  return tied;
}

double depth_spread_mm(const LevelledPress& press, const MapOptics& optics, const ModelFit& fit) {
  const double level = mean_level(press);
  const auto depth_mm = [&](const PixelFilter& use) {
    const PressProfile profile = profile_of(press, optics.light_levels, optics.smoothing_mm, use);
    const ModelFit part = fit_model(std::span(&profile, 1), fit);
    return look_up_mm(lists_of(part.layer, optics, part.deepest_mm()).front(), level);
  };
  try {
    const double all_mm = depth_mm({});
    double most_mm = 0;
    for (const PixelFilter& part : parts_of(press)) {
      most_mm = std::max(most_mm, std::abs(depth_mm(part) - all_mm));
    }
    return most_mm;
  } catch (const ModelRefused&) {
    return std::numeric_limits<double>::infinity();
  }
}

Calibration build_alone(const BallPresses& set, const recon::SpatialGain& gain,
                        PressReport& report) {
  if (set.presses.size() != 1) return build(set, &report);
  PressChoices choices;
  Calibration made = build(only_press(set, gain), &choices);
  report.note = choices.describe();
  return made;
}

Calibration build_layered(const BallPresses& set, const recon::SpatialGain& gain,
                          PressReport& report) {
  const bool measured = std::ranges::any_of(
      set.presses, [](const BallPresses::Press& press) { return press.depth_mm.has_value(); });
  if (measured) return build_alone(set, gain, report);
  FittedCalibration fitted;
  try {
    fitted = build_model(set, gain);
  } catch (const std::runtime_error& e) {
    Calibration made = build_alone(set, gain, report);
    add_line(report.note, fmt::format("list: what the presses show alone, since {}", e.what()));
    return made;
  }
  if (fitted.fit.explains()) {
    report.note = fitted.describe_press();
    add_line(report.note, "list: of a layer, which explains all but noise");
    report.left_out = std::move(fitted.left_out);
    report.presses = std::move(fitted.presses);
    return std::move(fitted.calibration);
  }
  if (const double spread_mm = spread_of(fitted, set); spread_mm > kMostSpread) {
    Calibration made = build_alone(set, gain, report);
    add_line(report.note,
             fmt::format("list: what the presses show alone: layers fitted to parts of a press's "
                         "picture put it {:.2f} mm deeper or shallower, and {:.2f} mm are allowed",
                         spread_mm, kMostSpread));
    return made;
  }
  return set.presses.size() == 1 ? tied_to(fitted, set, gain, report)
                                 : chained_at(fitted, set, report);
}

}  // namespace dtact::calibration
