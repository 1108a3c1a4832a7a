#include "clients/calibrate/fit/model/layered_build.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/fit/list_shape.hpp"
#include "clients/calibrate/fit/model/model_build.hpp"
#include "clients/calibrate/fit/model/tied_list.hpp"

namespace dtact::calibration {
namespace {

/// By how much the layer's depth of a press may differ from where the darkening's straight line
/// ends, millimetres. On nine simulated sensors of two laws it did by 0.11 at most; a robot that
/// measured 17 real ones found zeros off by 0.155.
constexpr double kMostMoved = 0.2;

BallPress only_press(const BallPresses& set, const recon::SpatialGain& gain) {
  return {.reference_q8 = set.reference_q8,
          .frames = set.presses.front().frames,
          .ball_radius_mm = set.ball_radius_mm,
          .mm_per_px = set.mm_per_px,
          .lens = set.lens,
          .crop = set.crop,
          .gain = gain,
          // A lens file says what its pins ask for.
          .may_share_light = !set.lens};
}

/// The press as a calibration sees it, without the gain that is the press's own.
LevelledPress seen(const Calibration& calibration, const BallPresses& set, const PressGain& gain) {
  const SettledPress settled = settle(*calibration.model, set.reference_q8.pixels,
                                      set.presses.front().frames, set.ball_radius_mm);
  return levelled(settled.map, settled.contact, gain);
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

/// "; the layer itself leaves 0.20 grey levels".
std::string left_by(const FittedCalibration& fitted) {
  return fmt::format("; the layer itself leaves {:.2f} grey levels",
                     fitted.calibration.layer->residual_levels);
}

std::string not_believed(double moved_mm) {
  return fmt::format(
      "list: what the presses show alone, since a layer would put them {:+.2f} mm deeper, and "
      "{:.2f} mm are believed",
      moved_mm, kMostMoved);
}

Calibration tied_to(const FittedCalibration& fitted, const BallPresses& set,
                    const recon::SpatialGain& gain, PressReport& report) {
  PressChoices choices;
  Calibration made = build(only_press(set, gain), &choices);
  report.note = choices.describe();
  const LevelledPress by_press = seen(made, set, choices.press_gain.gain);
  const LevelledPress by_layer = seen(fitted.calibration, set, fitted.press_gains.front().gain);
  const recon::Model& of_layer = *fitted.calibration.model;
  const LayerList layer{&of_layer.list, mean_level(by_layer) / mean_level(by_press)};
  auto model = std::make_shared<recon::Model>(*made.model);
  TiedList tied = tie(model->list, layer, by_press);
  if (std::abs(tied.moved_mm) > kMostMoved) {
    add_line(report.note, not_believed(tied.moved_mm));
    return made;
  }
  model->list = std::move(tied.list);
  model->uncertainty = uncertainty_of(model->list, layer, of_layer);
  made.model = std::move(model);
  made.layer = fitted.calibration.layer;
  add_line(report.note,
           fmt::format("list: what the press shows, at the depth of a layer, {:+.3f} mm "
                       "from where the darkening's straight line ends{}",
                       tied.moved_mm, left_by(fitted)));
  return made;
}

/// Mean of how much deeper the layer puts the presses, millimetres.
double moved_by(const FittedCalibration& fitted, const PressReport& alone) {
  double sum = 0;
  double count = 0;
  for (const PressReport::Depth& press : alone.presses) {
    const auto other = std::ranges::find(fitted.presses, press.name, &PressReport::Depth::name);
    if (other == fitted.presses.end()) continue;
    sum += other->depth_mm - press.depth_mm;
    count += 1;
  }
  return count > 0 ? sum / count : 0;
}

/// None where the presses alone leave a gap.
std::optional<Calibration> chained_alone(const BallPresses& set, PressReport& report) {
  try {
    return build(set, &report);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

Calibration chained_at(const FittedCalibration& fitted, const BallPresses& set,
                       PressReport& report) {
  std::optional<Calibration> alone = chained_alone(set, report);
  if (const double moved = moved_by(fitted, report); alone && std::abs(moved) > kMostMoved) {
    report.note = not_believed(moved);
    return *std::move(alone);
  }
  BallPresses at_depths = set;
  std::erase_if(at_depths.presses, [&](BallPresses::Press& press) {
    const auto used = std::ranges::find(fitted.presses, press.name, &PressReport::Depth::name);
    if (used == fitted.presses.end()) return true;
    press.depth_mm = used->depth_mm;
    return false;
  });
  Calibration made = build(at_depths, &report);
  report.left_out.insert(report.left_out.begin(), fitted.left_out.begin(), fitted.left_out.end());
  report.note = "list: what the presses show, at the depths of a layer" + left_by(fitted);
  made.layer = fitted.calibration.layer;
  return made;
}

}  // namespace

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
  if (!fitted.fit.explains()) {
    return set.presses.size() == 1 ? tied_to(fitted, set, gain, report)
                                   : chained_at(fitted, set, report);
  }
  report.note = fitted.describe_press();
  add_line(report.note, "list: of a layer, which explains all but noise");
  report.left_out = std::move(fitted.left_out);
  report.presses = std::move(fitted.presses);
  return std::move(fitted.calibration);
}

}  // namespace dtact::calibration
