#include "clients/calibrate/fit/model/model_build.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "clients/calibrate/fit/model/model_lut.hpp"
#include "daemon/recon/kernels.hpp"

namespace dtact::calibration {
namespace {

constexpr double kMaxResidual = 0.5;  // grey levels
/// Grey levels count as shares of the light where that leaves at most this part of the error: on
/// sensor_a 0.7 of the error, on sensor_b 1.02 (half-disc); in the simulator it is a share.
constexpr double kRounder = 0.8;
constexpr double kDeepest = 0.92;           // of the thickness
constexpr double kReportedDarkening = 0.5;  // grey levels of a press's offset

/// Mean of the reference without its dark parts: GainShape::uniform normalises darkening to it.
double light_of(const recon::RectifyTable& table, const image::Grey16& reference_q8) {
  double sum = 0;
  double count = 0;
  for (const std::uint8_t level : rectified_reference(table, reference_q8).pixels) {
    if (level * 64 < recon::kernels::kDarkest_q6) continue;
    sum += level;
    count += 1;
  }
  return count > 0 ? sum / count : 0;
}

/// Asymmetry of the contacts in the picture: root mean square distance from the mean at
/// each radius over the peak's level, over all presses.
double lopsided(std::span<const SettledPress> presses) {
  double sum = 0;
  double count = 0;
  for (const SettledPress& press : presses) {
    const double reach = press.contact.radius_mm;
    const RadialProfile profile = radial_profile(press.map, press.contact, reach);
    for (int y = 0; y < press.map.height; ++y) {
      for (int x = 0; x < press.map.width; ++x) {
        const double r = distance_mm(press.map, press.contact, x, y);
        const double level = press.map.at(x, y);
        if (r >= reach || std::isnan(level)) continue;
        const double off = (level - profile.at(r)) / press.contact.peak_levels;
        sum += off * off;
        count += 1;
      }
    }
  }
  return std::sqrt(sum / count);
}

/// A press is found at two positions: a dark part passes as the ball.
bool disagree(const UsablePresses& seen, const UsablePresses& shares, double mm_per_px) {
  for (std::size_t i = 0; i < seen.indices.size(); ++i) {
    const auto same = std::ranges::find(shares.indices, seen.indices[i]);
    if (same == shares.indices.end()) continue;
    const auto at = static_cast<std::size_t>(same - shares.indices.begin());
    if (!same_place(seen.presses[i].contact, shares.presses[at].contact, mm_per_px)) return true;
  }
  return false;
}

void refuse(const FittedCalibration& made) {
  const double residual = made.fit.residual * made.light_levels;
  if (residual > kMaxResidual) {
    throw ModelRefused(fmt::format(
        "no gel explains the press: what is left is {:.2f} grey levels (at most {}); check the "
        "ball's radius and the scale, that the ball was clean and at rest, and that the light is "
        "even",
        residual, kMaxResidual));
  }
  const double thickness = made.fit.gel.thickness_mm;
  if (made.fit.deepest_mm() > kDeepest * thickness) {
    throw ModelRefused(fmt::format(
        "the press fits only as {:.2f} mm deep in a gel of {:.2f} mm, deeper than can be; check "
        "the ball's radius and the scale, press lighter, and look for dark corners in the "
        "reference",
        made.fit.deepest_mm(), thickness));
  }
}

/// The fit with its errors, converted from logarithms.
GelEstimate describe(const ModelFit& fit, double light_levels) {
  const auto deviation = [&](Eigen::Index i) { return std::sqrt(fit.covariance(i, i)); };
  const recon::Scattering& scattering = fit.gel.scattering;
  const double weight = scattering.narrow_weight;
  GelEstimate gel;
  gel.thickness_mm = {fit.gel.thickness_mm, fit.gel.thickness_mm * deviation(ModelFit::kThickness)};
  // The fit does not distinguish its two widths; gel_of() sorts them.
  const bool crossed = fit.parameters[ModelFit::kNarrow] > fit.parameters[ModelFit::kWide];
  const auto narrow = crossed ? ModelFit::kWide : ModelFit::kNarrow;
  const auto wide = crossed ? ModelFit::kNarrow : ModelFit::kWide;
  gel.narrow_mm = {scattering.narrow_mm, scattering.narrow_mm * deviation(narrow)};
  gel.wide_mm = {scattering.wide_mm, scattering.wide_mm * deviation(wide)};
  gel.narrow_weight = {weight, weight * (1 - weight) * deviation(ModelFit::kOdds)};
  for (std::size_t i = 0; i < gel.slope.size(); ++i) {
    const double slope = fit.gel.response.slopes[i];
    gel.indentation[i] = Response::kKnots[i];
    gel.slope[i] = {slope, slope * deviation(ModelFit::kSlopes + static_cast<Eigen::Index>(i))};
  }
  gel.bulge_factor = fit.gel.response.bulge_factor;
  gel.residual_levels = fit.residual * light_levels;
  return gel;
}

}  // namespace

std::string FittedCalibration::describe_press() const {
  if (press_asymmetries.size() != 1) return {};
  std::string text = press_asymmetries.front().describe();
  const double darker = fit.presses.front().offset * light_levels;
  if (std::abs(darker) > kReportedDarkening) {
    text += fmt::format(
        "\nlight: far from the ball the picture is {:.1f} grey levels {} than the reference; no "
        "gel does that, so the LUT was made without them",
        std::abs(darker), darker > 0 ? "darker" : "brighter");
  }
  return text;
}

FittedCalibration build_model(const BallPresses& set, const recon::FlatFieldGain& gain) {
  check_sizes(set.ball_radius_mm, set.mm_per_px);
  FittedCalibration made;
  made.calibration =
      empty_calibration(set.reference_q8, set.crop, set.mm_per_px, set.lens, set.view);
  auto model = std::make_shared<recon::Model>(*made.calibration.model);
  model->gain = gain_on_map(gain, made.calibration);
  UsablePresses seen = settle_each(*model, set);
  if (!set.gain_specified && gain.shape == recon::GainShape::none && gain.polynomial.empty()) {
    // The loss is a share of the light. Rings do not show whether a sensor's picture is one, but
    // where it is not, a share of uneven light makes a round dent asymmetric.
    recon::Model uniform = *model;
    uniform.gain.shape = recon::GainShape::uniform;
    UsablePresses shares = settle_each(uniform, set);
    if (shares.presses.size() >= seen.presses.size() && !shares.presses.empty() &&
        !disagree(seen, shares, set.mm_per_px) &&
        (seen.presses.empty() || lopsided(seen.presses) > kRounder * lopsided(shares.presses))) {
      model->gain = uniform.gain;
      seen = std::move(shares);
    }
  }
  made.left_out = std::move(seen.left_out);
  if (seen.presses.empty()) {
    throw std::runtime_error(fmt::format("{}", fmt::join(made.left_out, "; ")));
  }
  made.light_levels = light_of(model->rectify, set.reference_q8);
  const MapOptics optics{made.light_levels, model->smoothing_px * set.mm_per_px, set.mm_per_px};
  std::vector<PressProfile> profiles;
  profiles.reserve(seen.presses.size());
  for (const SettledPress& press : seen.presses) {
    made.press_asymmetries.push_back(
        choose_asymmetry(sure_samples(press.map, press.contact), set.ball_radius_mm));
    profiles.push_back(
        profile_of(without_asymmetry(press.map, press.contact, made.press_asymmetries.back().gain),
                   optics.light_levels, optics.smoothing_mm));
  }
  // A misfit for one press is worse for several, and each costs as much time.
  const auto deepest = std::ranges::max_element(
      seen.presses, {}, [](const SettledPress& press) { return press.contact.peak_levels; });
  made.fit = fit_model({&profiles[static_cast<std::size_t>(deepest - seen.presses.begin())], 1});
  refuse(made);
  if (profiles.size() > 1) {
    made.fit = fit_model(profiles, made.fit);
    refuse(made);
  }
  for (std::size_t i = 0; i < seen.indices.size(); ++i) {
    made.presses.push_back({set.presses[seen.indices[i]].name, made.fit.presses[i].depth_mm});
  }

  model->scattering = made.fit.gel.scattering;
  std::array<ModelLut, kLuts> luts = luts_of(made.fit, optics);
  model->lut = std::move(luts.front().lut);
  model->uncertainty = std::move(luts.front().uncertainty);
  for (std::size_t i = 1; i < luts.size(); ++i) {
    model->sharpened.push_back(
        {static_cast<int>(i), std::move(luts[i].lut), std::move(luts[i].uncertainty)});
  }
  made.calibration.gel = describe(made.fit, optics.light_levels);
  made.calibration.model = std::move(model);
  return made;
}

}  // namespace dtact::calibration
