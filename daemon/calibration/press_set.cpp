#include "daemon/calibration/press_set.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "daemon/calibration/chain_fit.hpp"

namespace dtact::calibration {
namespace {

constexpr double kSure = 0.6;  // of the contact's radius: nearer the edge its scattered light tells
/// The layer's contact with a ball is narrower than the circle in which the ball cuts the untouched
/// surface: 3.04 mm against 3.12 for a 4 mm ball 1.5 mm deep (solved for 2 to 2.5 mm thickness).
constexpr double kContactOfCut = 0.97;
constexpr int kRounds = 4;  // until the contacts' radii have followed the depths
constexpr double kDepthBinMm = 0.2;
/// Presses of one ball agree among themselves within a micrometre or two however the layer scatters
/// light; a ball of another radius is off by more: 0.012 to 0.036 mm on depths about 0.8 in layers
/// of 1.5 to 3 mm (simulator). The share that covers them.
constexpr double kOtherShape = 0.05;
/// Uniform gain has to predict better by this factor: otherwise the simpler list stays.
constexpr double kWorthIt = 0.98;

double sag_mm(double ball_radius, double r) {
  return ball_radius - std::sqrt(std::max(0.0, ball_radius * ball_radius - r * r));
}

/// The rings of one press within `reach_mm`, one pixel wide.
SagProfile rings_of(const SettledPress& press, double reach_mm, std::optional<double> depth_mm) {
  SagProfile profile{.rings = {}, .depth_mm = depth_mm};
  const double step = press.map.mm_per_px;
  profile.rings.resize(static_cast<std::size_t>(std::max(1.0, std::ceil(reach_mm / step))));
  for (int y = 0; y < press.map.height; ++y) {
    for (int x = 0; x < press.map.width; ++x) {
      const double r = distance_mm(press.map, press.contact, x, y);
      const double level = press.map.at(x, y);
      if (!(r < reach_mm) || std::isnan(level)) continue;
      auto& ring = profile.rings[static_cast<std::size_t>(r / step)];
      ring.level += level;
      ring.sag_mm += sag_mm(press.contact.ball_radius_mm, r);
      ring.weight += 1;
    }
  }
  std::erase_if(profile.rings, [](const auto& ring) { return ring.weight == 0; });
  for (auto& ring : profile.rings) {
    ring.level /= ring.weight;
    ring.sag_mm /= ring.weight;
  }
  return profile;
}

struct Fitted {
  std::vector<SettledPress> presses;
  std::vector<SagProfile> profiles;
  ChainFit chain;
};

/// The presses in which a contact is found; the others' reasons go to `left_out`.
std::vector<SettledPress> settle_all(const recon::Model& model, BallPresses& set,
                                     std::vector<std::string>& left_out) {
  std::vector<SettledPress> presses;
  std::vector<BallPresses::Press> used;
  for (BallPresses::Press& press : set.presses) {
    try {
      presses.push_back(settle(model, set.reference_q8.pixels, press.frames, set.ball_radius_mm));
      used.push_back(std::move(press));
    } catch (const std::runtime_error& e) {
      left_out.push_back(fmt::format("{}: {}", press.name, e.what()));
    }
  }
  set.presses = std::move(used);
  if (presses.size() < 2) {
    throw std::runtime_error(
        fmt::format("a chain of presses needs at least two in which a contact is found: press "
                    "lighter and deeper{}{}",
                    left_out.empty() ? "" : "; left out: ", fmt::join(left_out, "; ")));
  }
  return presses;
}

/// Alternates between the contacts' radii and the chain.
Fitted fit(std::vector<SettledPress> presses, const BallPresses& set) {
  Fitted fitted{.presses = std::move(presses), .profiles = {}, .chain = {}};
  std::vector<double> reach_mm;
  reach_mm.reserve(fitted.presses.size());
  for (const SettledPress& press : fitted.presses) {
    reach_mm.push_back(kSure * press.contact.radius_mm);
  }
  for (int round = 0; round < kRounds; ++round) {
    fitted.profiles.clear();
    for (std::size_t p = 0; p < set.presses.size(); ++p) {
      fitted.profiles.push_back(rings_of(fitted.presses[p], reach_mm[p], set.presses[p].depth_mm));
    }
    fitted.chain = fit_chain(fitted.profiles);
    for (std::size_t p = 0; p < set.presses.size(); ++p) {
      const double g = std::clamp(fitted.chain.depth_mm[p], 0.0, set.ball_radius_mm);
      const double cut = std::sqrt(g * (2 * set.ball_radius_mm - g));
      const double seen = fitted.presses[p].contact.radius_mm;
      // A depth that is far off in the first rounds must not empty or flood the contact.
      reach_mm[p] = kSure * std::clamp(kContactOfCut * cut, 0.5 * seen, seen);
    }
  }
  return fitted;
}

/// How far each press's rings are from the list of all the others.
struct Prediction {
  double depth_mm = 0;
  double error_mm = 0;
  double weight = 0;
};
std::vector<Prediction> predict_each(const Fitted& fitted) {
  std::vector<Prediction> out;
  for (std::size_t left = 0; left < fitted.profiles.size(); ++left) {
    std::vector<SagProfile> others = fitted.profiles;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(left));
    const ChainFit chain = fit_chain(others);
    for (const auto& ring : fitted.profiles[left].rings) {
      // Beyond what the others show nothing is claimed.
      if (ring.level > chain.knots.back().level) continue;
      const double depth = fitted.chain.depth_mm[left] - ring.sag_mm;
      const double error = interpolate(chain.knots, std::max(0.0, ring.level)) - depth;
      out.push_back({depth, std::abs(error), ring.weight});
    }
  }
  return out;
}

double mean_error(const std::vector<Prediction>& predictions) {
  double sum = 0;
  double weight = 0;
  for (const Prediction& p : predictions) {
    sum += p.error_mm * p.weight;
    weight += p.weight;
  }
  return weight > 0 ? sum / weight : 0;
}

std::vector<recon::Model::Uncertainty> uncertainty_of(const std::vector<Prediction>& predictions) {
  struct Bin {
    double depth = 0;
    double error = 0;
    double weight = 0;
  };
  std::vector<Bin> bins;
  for (const Prediction& p : predictions) {
    const auto bin = static_cast<std::size_t>(std::max(0.0, p.depth_mm) / kDepthBinMm);
    if (bin >= bins.size()) bins.resize(bin + 1);
    bins[bin].depth += p.depth_mm * p.weight;
    bins[bin].error += p.error_mm * p.weight;
    bins[bin].weight += p.weight;
  }
  std::vector<recon::Model::Uncertainty> rows;
  for (const Bin& bin : bins) {
    if (bin.weight > 0) {
      const double depth_mm = std::max(0.0, bin.depth / bin.weight);
      const double error_mm = std::hypot(bin.error / bin.weight, kOtherShape * depth_mm);
      rows.push_back({std::round(1000 * depth_mm) / 1000, std::round(10000 * error_mm) / 10});
    }
  }
  return rows;
}

void refuse_gaps(const ChainFit& chain, const BallPresses& set) {
  const bool tied = std::ranges::any_of(set.presses, [](const auto& p) { return !!p.depth_mm; });
  if (chain.gaps.empty() || tied) return;
  const ChainFit::Gap& gap = chain.gaps.front();
  const double g = std::min(gap.to_mm, set.ball_radius_mm);
  throw std::runtime_error(fmt::format(
      "no press shows indentations from {:.2f} to {:.2f} mm, so the list cannot be chained there: "
      "press the ball about {:.2f} mm deep (a contact {:.1f} mm wide) and add that press",
      gap.from_mm, gap.to_mm, g, 2 * kContactOfCut * std::sqrt(g * (2 * set.ball_radius_mm - g))));
}

}  // namespace

Calibration build(const BallPresses& presses, PressReport* report) {
  BallPresses set = presses;
  Calibration calibration = empty_calibration(set.reference_q8, set.crop, set.mm_per_px, set.lens);
  const recon::Model plain = *calibration.model;
  recon::Model uniform = plain;
  uniform.gain.shape = recon::GainShape::uniform;

  PressReport found;
  // With one gain a faint press may be seen and with the other not: both get what both see.
  (void)settle_all(plain, set, found.left_out);
  Fitted lit = fit(settle_all(uniform, set, found.left_out), set);
  Fitted fitted = fit(settle_all(plain, set, found.left_out), set);
  std::vector<Prediction> predictions = predict_each(fitted);
  const std::vector<Prediction> lit_predictions = predict_each(lit);
  const double without = mean_error(predictions);
  const double with = mean_error(lit_predictions);
  auto model = std::make_shared<recon::Model>(plain);
  if (with < kWorthIt * without) {
    *model = uniform;
    fitted = std::move(lit);
    predictions = lit_predictions;
  }
  refuse_gaps(fitted.chain, set);

  // The bulge of the deepest press is the one seen best.
  const auto deepest = static_cast<std::size_t>(std::ranges::max_element(fitted.chain.depth_mm) -
                                                fitted.chain.depth_mm.begin());
  const SettledPress& press = fitted.presses[deepest];
  const std::vector<Knot>& knots = fitted.chain.knots;
  const std::size_t last = knots.size() - 1;
  const std::size_t before = last >= 4 ? last - 4 : 0;
  const double beyond =
      (knots[last].depth_mm - knots[before].depth_mm) / (knots[last].level - knots[before].level);
  model->list = make_list(knots, knots.front().depth_mm / knots.front().level, beyond,
                          radial_profile(press.map, press.contact, kFarField * set.ball_radius_mm));
  model->uncertainty = uncertainty_of(predictions);
  calibration.model = std::move(model);
  if (report != nullptr) {
    for (std::size_t p = 0; p < set.presses.size(); ++p) {
      found.presses.push_back({set.presses[p].name, fitted.chain.depth_mm[p]});
    }
    found.without_gain_mm = without;
    found.uniform_gain_mm = with;
    *report = std::move(found);
  }
  return calibration;
}

}  // namespace dtact::calibration
