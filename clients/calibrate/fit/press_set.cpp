#include "clients/calibrate/fit/press_set.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/fit/chain_fit.hpp"
#include "clients/calibrate/fit/lut_uncertainty.hpp"

namespace dtact::calibration {
namespace {

/// Presses of one ball agree within a micrometre or two however the gel scatters
/// light; a ball of another radius is off by more: 0.012 to 0.036 mm on depths about 0.8 in gels
/// of 1.5 to 3 mm (simulator). This share covers them.
constexpr double kOtherShape = 0.05;

/// The end of a refusal, so that the user does not search for a press that was made but not used.
std::string name_left_out(const std::vector<std::string>& left_out) {
  return left_out.empty() ? "" : fmt::format("; left out: {}", fmt::join(left_out, "; "));
}

/// The usable presses, which alone stay in `set`; the others' reasons go to `left_out`.
std::vector<SettledPress> settle_all(const recon::Model& model, BallPresses& set,
                                     std::vector<std::string>& left_out) {
  UsablePresses usable = settle_each(model, set);
  std::ranges::move(usable.left_out, std::back_inserter(left_out));
  std::vector<BallPresses::Press> used;
  used.reserve(usable.indices.size());
  for (const std::size_t p : usable.indices) used.push_back(std::move(set.presses[p]));
  set.presses = std::move(used);
  if (usable.presses.size() < 2) {
    throw std::runtime_error(
        fmt::format("a chain of presses needs at least two in which a contact is found: press "
                    "lighter and deeper{}",
                    name_left_out(left_out)));
  }
  return std::move(usable.presses);
}

/// Why the presses make no chain as a share of the light; empty: they do. In dark parts a few grey
/// levels are a large share of the light, and in bright parts a faint press is too small a share.
std::string lost_to_the_share(const recon::Model& uniform, const BallPresses& set,
                              const std::vector<SettledPress>& seen) {
  std::size_t found = 0;
  for (std::size_t p = 0; p < seen.size(); ++p) {
    const BallPresses::Press& press = set.presses[p];
    try {
      const Contact lit =
          settle(uniform, set.reference_q8.pixels, press.frames, set.ball_radius_mm).contact;
      if (same_place(seen[p].contact, lit, set.mm_per_px)) {
        ++found;
        continue;
      }
      return fmt::format(
          "{}: the most of its light is lost at column {:.0f}, row {:.0f} of the depth map",
          press.name, lit.col, lit.row);
    } catch (const NoContact&) {
      continue;
    } catch (const std::runtime_error& e) {
      return fmt::format("{}: {}", press.name, e.what());
    }
  }
  return found < 2 ? "fewer than two are dark enough" : "";
}

/// One gain, and the agreement of the presses under it.
struct Trial {
  const std::vector<SettledPress>* presses = nullptr;
  recon::GainShape shape = recon::GainShape::none;
  std::vector<PressRings> rings;
  ChainFit fit;  ///< Fit to all presses.
  LeaveOneOut left_out;
  std::vector<double> errors_mm;  ///< Error of each press when left out; NaN: unknown.
};

std::string name_of(const Trial& trial) {
  const std::size_t terms = trial.rings.front().all.place.size();
  std::string name = trial.shape == recon::GainShape::uniform ? "share of the light" : "";
  if (terms > 0) {
    name += fmt::format("{}{}", name.empty() ? "" : ", ", terms == 2 ? "plane" : "quadratic");
  }
  return name.empty() ? "none" : name;
}

Trial try_gain(const std::vector<SettledPress>& presses, const BallPresses& set,
               recon::GainShape shape, int terms) {
  Trial trial{
      .presses = &presses, .shape = shape, .rings = {}, .fit = {}, .left_out = {}, .errors_mm = {}};
  for (std::size_t p = 0; p < presses.size(); ++p) {
    trial.rings.push_back(rings_of(presses[p], set.presses[p].depth_mm, terms));
  }
  trial.fit = chain_presses(trial.rings).fit;
  trial.left_out = leave_one_out(trial.rings);
  for (const LeftOutResidual& residuals : trial.left_out.residuals)
    trial.errors_mm.push_back(residuals.mean_error_mm());
  return trial;
}

/// Mean of `value(press)` over the presses for which every trial has a value, and its standard
/// error.
struct Mean {
  double mean = 0;
  double standard_error = 0;
};
template <typename Value>
Mean mean_over(const std::vector<Trial>& trials, const Value& value) {
  double n = 0;
  double sum = 0;
  double squares = 0;
  for (std::size_t p = 0; p < trials.front().errors_mm.size(); ++p) {
    if (std::ranges::any_of(trials, [p](const Trial& t) { return std::isnan(t.errors_mm[p]); })) {
      continue;
    }
    n += 1;
    sum += value(p);
    squares += value(p) * value(p);
  }
  if (n < 2) return {n > 0 ? sum : 0, std::numeric_limits<double>::infinity()};
  const double mean = sum / n;
  return {mean, std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1))};
}

/// The first trial whose prediction is at most one standard error of their difference worse than
/// the best (Breiman et al. 1984, section 3.4.3).
std::size_t simplest(const std::vector<Trial>& trials, std::vector<PressReport::Gain>& report) {
  std::size_t best = 0;
  for (std::size_t t = 0; t < trials.size(); ++t) {
    const auto error = [&](std::size_t p) { return trials[t].errors_mm[p]; };
    report[t].error_mm = mean_over(trials, error).mean;
    if (report[t].error_mm < report[best].error_mm) best = t;
  }
  std::size_t chosen = best;
  for (std::size_t t = trials.size(); t-- > 0;) {
    const auto worse = [&](std::size_t p) {
      return trials[t].errors_mm[p] - trials[best].errors_mm[p];
    };
    const Mean difference = mean_over(trials, worse);
    report[t].standard_error_mm = t == best ? 0 : difference.standard_error;
    if (difference.mean <= difference.standard_error) chosen = t;
  }
  return chosen;
}

/// The darkening at which the first LUT that reaches the depth reads it.
double level_at(const std::vector<ChainFit>& luts, double depth_mm) {
  for (const ChainFit& lut : luts) {
    Knot below;
    for (const Knot& knot : lut.knots) {
      if (knot.depth_mm >= depth_mm && knot.depth_mm > below.depth_mm) {
        return std::lerp(below.level, knot.level,
                         (depth_mm - below.depth_mm) / (knot.depth_mm - below.depth_mm));
      }
      below = knot;
    }
  }
  return luts.front().knots.back().level;
}

/// Change of the LUT at a depth with the presses that make it: the jackknife's standard error
/// (Efron and Tibshirani 1993, section 11.2), millimetres.
double jackknife_mm(const LeaveOneOut& left_out, double depth_mm) {
  double n = 0;
  double sum = 0;
  double squares = 0;
  // Levels differ from press to press by the gain; at the mean place it is about one.
  const double level = level_at(left_out.without, depth_mm);
  for (const ChainFit& lut : left_out.without) {
    if (level > lut.knots.back().level) continue;
    const double read = interpolate(lut.knots, level);
    n += 1;
    sum += read;
    squares += read * read;
  }
  if (n < 2) return 0;
  return std::sqrt(std::max(0.0, (n - 1) / n * (squares - sum * sum / n)));
}

/// Influence of the ring's scattered light on the LUT, the mean over the presses: presses of one
/// ball agree in spite of it.
double ring_uncertainty_mm(const Trial& trial) {
  const Knot& deepest = trial.fit.knots.back();
  double sum = 0;
  for (const SettledPress& press : *trial.presses) {
    sum += ring_uncertainty_mm(press, deepest.depth_mm / deepest.level);
  }
  return sum / static_cast<double>(trial.presses->size());
}

/// At each indentation bin: the left-out presses' distance from the known shape, the LUT's change
/// with the presses that make it, the error for another shape, and the influence of the
/// ring.
std::vector<recon::Model::Uncertainty> uncertainty_of(const LeaveOneOut& left_out, double ring_mm) {
  struct Bin {
    double depth = 0;
    double error = 0;
    double weight = 0;
  };
  std::vector<Bin> bins;
  for (const LeftOutResidual& residuals : left_out.residuals) {
    for (const LeftOutResidual::Ring& ring : residuals.rings) {
      const auto bin = static_cast<std::size_t>(std::max(0.0, ring.depth_mm) / kDepthBinMm);
      if (bin >= bins.size()) bins.resize(bin + 1);
      bins[bin].depth += ring.depth_mm * ring.weight;
      bins[bin].error += std::abs(ring.error_mm) * ring.weight;
      bins[bin].weight += ring.weight;
    }
  }
  std::vector<recon::Model::Uncertainty> rows;
  for (const Bin& bin : bins) {
    if (bin.weight > 0) {
      const double depth_mm = std::max(0.0, bin.depth / bin.weight);
      const double error_mm =
          std::hypot(std::hypot(bin.error / bin.weight, jackknife_mm(left_out, depth_mm),
                                kOtherShape * depth_mm),
                     ring_mm);
      rows.push_back({std::round(1000 * depth_mm) / 1000, std::round(10000 * error_mm) / 10});
    }
  }
  return rows;
}

void refuse_gaps(const ChainFit& chain, const BallPresses& set,
                 const std::vector<std::string>& left_out) {
  const bool constrained =
      std::ranges::any_of(set.presses, [](const auto& p) { return !!p.depth_mm; });
  if (chain.gaps.empty() || constrained) return;
  const ChainFit::Gap& gap = chain.gaps.front();
  const double g = std::min(gap.to_mm, set.ball_radius_mm);
  throw std::runtime_error(fmt::format(
      "no press shows indentations from {:.2f} to {:.2f} mm, so the LUT cannot be chained there: "
      "press the ball about {:.2f} mm deep (a contact {:.1f} mm wide) and add that press{}",
      gap.from_mm, gap.to_mm, g, 2 * kContactOfCut * std::sqrt(g * (2 * set.ball_radius_mm - g)),
      name_left_out(left_out)));
}

}  // namespace

UsablePresses settle_each(const recon::Model& model, const BallPresses& set) {
  UsablePresses usable;
  for (std::size_t p = 0; p < set.presses.size(); ++p) {
    const BallPresses::Press& press = set.presses[p];
    try {
      usable.presses.push_back(
          settle_unclipped(model, set.reference_q8, press.frames, set.ball_radius_mm));
      usable.indices.push_back(p);
    } catch (const std::runtime_error& e) {
      usable.left_out.push_back(fmt::format("{}: {}", press.name, e.what()));
    }
  }
  return usable;
}

Calibration build(const BallPresses& presses, PressReport* report) {
  check_sizes(presses.ball_radius_mm, presses.mm_per_px);
  BallPresses set = presses;
  Calibration calibration =
      empty_calibration(set.reference_q8, set.crop, set.mm_per_px, set.lens, set.view);
  const recon::Model plain = *calibration.model;
  recon::Model uniform = plain;
  uniform.gain.shape = recon::GainShape::uniform;

  PressReport found;
  std::vector<SettledPress> seen = settle_all(plain, set, found.left_out);
  std::vector<SettledPress> lit;
  if (const std::string lost = lost_to_the_share(uniform, set, seen); !lost.empty()) {
    found.note = fmt::format(
        "light: as it is, since as a share of the light a press is not found ({}); where a part of "
        "the map is dark, --crop leaves it out",
        lost);
  } else {
    // A faint press may be found with one gain and not with the other: both get the common presses.
    lit = settle_all(uniform, set, found.left_out);
    seen = settle_all(plain, set, found.left_out);
  }
  std::vector<Trial> trials;
  for (const int terms : {0, 2, 5}) {
    // With only as many presses as the gain has factors, its prediction cannot be tested.
    if (terms > 0 && static_cast<int>(seen.size()) < terms + 3) break;
    trials.push_back(try_gain(seen, set, recon::GainShape::none, terms));
    if (!lit.empty()) trials.push_back(try_gain(lit, set, recon::GainShape::uniform, terms));
  }
  std::erase_if(trials, [&](const Trial& trial) {
    return !reaches_corners({.polynomial = trial.fit.gain}, plain.rectify.width * set.mm_per_px,
                            plain.rectify.height * set.mm_per_px);
  });
  for (const Trial& trial : trials) found.gains.push_back({.name = name_of(trial)});
  const std::size_t choice = simplest(trials, found.gains);
  const Trial& chosen = trials[choice];
  const ChainFit& fit = chosen.fit;
  refuse_gaps(fit, set, found.left_out);

  auto model =
      std::make_shared<recon::Model>(chosen.shape == recon::GainShape::none ? plain : uniform);
  model->gain.polynomial = fit.gain;
  // The bulge of the deepest press is the most visible one.
  const auto deepest =
      static_cast<std::size_t>(std::ranges::max_element(fit.depth_mm) - fit.depth_mm.begin());
  const SettledPress& press = (*chosen.presses)[deepest];
  RadialProfile profile = radial_profile(press.map, press.contact, kFarField * set.ball_radius_mm);
  for (double& level : profile.levels) {
    level *= gain_at(fit.gain, chosen.rings[deepest].all.place);
  }
  const std::vector<Knot>& knots = fit.knots;
  const std::size_t last = knots.size() - 1;
  const std::size_t before = last >= 4 ? last - 4 : 0;
  const double beyond =
      (knots[last].depth_mm - knots[before].depth_mm) / (knots[last].level - knots[before].level);
  model->lut = make_lut(knots, knots.front().depth_mm / knots.front().level, beyond, profile);
  model->uncertainty = uncertainty_of(chosen.left_out, ring_uncertainty_mm(chosen));
  calibration.model = std::move(model);
  if (report != nullptr) {
    for (std::size_t p = 0; p < set.presses.size(); ++p) {
      found.presses.push_back({set.presses[p].name, fit.depth_mm[p]});
    }
    found.gains[choice].chosen = true;
    *report = std::move(found);
  }
  return calibration;
}

}  // namespace dtact::calibration
