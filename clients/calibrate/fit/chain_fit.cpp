#include "clients/calibrate/fit/chain_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "clients/calibrate/fit/least_squares.hpp"

namespace dtact::calibration {
namespace {

constexpr double kKnotLevels = 2;  // grey levels from knot to knot
/// Weight of a bend of one millimetre between three knots, against all pixels off by a millimetre.
/// Presses of one ball cannot determine it: light scattered in from beyond the contact depends on
/// the contact's width, and a chain fits it with bends that the gel does not have. LUTs from the
/// freest to a straight line fit left-out presses within 1 to 4 µm while they differ by
/// 50 µm (simulated gels of 1.5, 2 and 3 mm). Leave-one-out selects the freest, and a 5 mm
/// ball reads 0.027, 0.029 and 0.059 mm off on the three; with this weight 0.031, 0.014 and 0.035,
/// with a third of it 0.026, 0.020 and 0.040, with a straight line 0.057, 0.022 and 0.029.
constexpr double kStraight = 0.3;
constexpr int kGainRounds = 3;
/// A gain that is off by a fifth weighs as much as all pixels off by a micrometre, the agreement of
/// presses: without this a gain that grows without end would scale all levels alike.
constexpr double kNearOne = 2.5e-5;
/// Weight of a measured depth, in pixels.
constexpr double kMeasured = 1e5;

/// Slope of a LUT at a darkening, millimetres a grey level.
double slope_at(const std::vector<Knot>& knots, double level) {
  const double low = std::max(0.0, level - kKnotLevels);
  const double high = std::min(knots.back().level, low + 2 * kKnotLevels);
  return (interpolate(knots, high) - interpolate(knots, low)) / (high - low);
}

/// The largest darkening of the presses under a gain.
double deepest_level(const std::vector<SagProfile>& presses, const std::vector<double>& gain) {
  double deepest = 0;
  for (const SagProfile& press : presses) {
    const double here = gain_at(gain, press.place);
    for (const auto& ring : press.rings) deepest = std::max(deepest, here * ring.level);
  }
  return deepest;
}

/// Intervals of indentation that the presses show, and the gaps between them.
std::vector<ChainFit::Gap> gaps_of(const std::vector<SagProfile>& presses, const ChainFit& fit) {
  std::vector<ChainFit::Gap> shown;
  for (const SagProfile& press : presses) {
    if (press.rings.empty()) continue;
    const double gain = gain_at(fit.gain, press.place);
    const auto [least, most] = std::ranges::minmax(press.rings, {}, &SagProfile::Ring::level);
    shown.push_back({interpolate(fit.knots, std::max(0.0, gain * least.level)),
                     interpolate(fit.knots, std::max(0.0, gain * most.level))});
  }
  std::ranges::sort(shown, {}, &ChainFit::Gap::from_mm);
  std::vector<ChainFit::Gap> gaps;
  double reached = 0;
  for (const ChainFit::Gap& interval : shown) {
    const double bridged = reached == 0 ? kBridgedFromZeroMm : kBridgedMm;
    if (interval.from_mm - reached > bridged) gaps.push_back({reached, interval.from_mm});
    reached = std::max(reached, interval.to_mm);
  }
  return gaps;
}

/// One linear solve under a gain. With the fit `before`, for its slopes, the change of the gain is
/// fitted as well and added to it.
ChainFit solve_once(const std::vector<SagProfile>& presses, const std::vector<double>& gain,
                    const ChainFit* before) {
  const double deepest = deepest_level(presses, gain);
  if (!(deepest > 0)) throw std::invalid_argument("no press is darker than the reference");
  const int knots = std::max(2, static_cast<int>(std::ceil(deepest / kKnotLevels)));
  const double step = deepest / knots;
  const auto terms = static_cast<int>(before == nullptr ? 0 : gain.size());
  // Unknowns: the knots 1 … n (knot 0 is zero), the presses' depths, the gain's change.
  const auto depth_of = [&](std::size_t press) { return knots + static_cast<Eigen::Index>(press); };
  const Eigen::Index first_term = depth_of(presses.size());
  LeastSquares squares(first_term + terms);
  double straight = 0;
  std::vector<LeastSquares::Term> row;
  for (std::size_t p = 0; p < presses.size(); ++p) {
    const double here = gain_at(gain, presses[p].place);
    double pixels = 0;
    for (const auto& ring : presses[p].rings) {
      pixels += ring.weight;
      const double level = std::max(0.0, here * ring.level);
      const auto [below, part] = between_knots(level / step, knots + 1);
      row = {{below, part}, {depth_of(p), -1}};
      if (below > 0) row.push_back({below - 1, 1 - part});
      for (int t = 0; t < terms; ++t) {
        row.push_back({first_term + t, slope_at(before->knots, level) * ring.level *
                                           presses[p].place[static_cast<std::size_t>(t)]});
      }
      squares.add(row, -ring.sag_mm, ring.weight);
    }
    straight += kStraight * pixels;
    if (terms > 0) {
      row.clear();
      for (int t = 0; t < terms; ++t) {
        row.push_back({first_term + t, presses[p].place[static_cast<std::size_t>(t)]});
      }
      squares.add(row, 1 - here, kNearOne * pixels);
    }
    const std::optional<double>& measured = presses[p].depth_mm;
    if (measured) squares.add({{depth_of(p), 1}}, *measured, kMeasured);
  }
  squares.add({{0, -2}, {1, 1}}, 0, straight);
  squares.straighten(0, knots, straight);
  const Eigen::VectorXd x = squares.solve();

  ChainFit fit;
  double risen = 0;
  for (int knot = 1; knot <= knots; ++knot) {
    risen = std::max(risen, x[knot - 1]);
    fit.knots.push_back({knot * step, risen, 1});
  }
  for (std::size_t p = 0; p < presses.size(); ++p) {
    fit.depth_mm.push_back(x[depth_of(p)]);
  }
  fit.gain = gain;
  for (int t = 0; t < terms; ++t) {
    fit.gain[static_cast<std::size_t>(t)] += x[first_term + t];
  }
  return fit;
}

constexpr double kSureOfSeen = 0.6;
constexpr int kChainRounds = 4;  // iterations of radii and depths

/// The sure contact's radius for a depth. A depth far off in the first rounds must neither empty
/// nor enlarge the contact much.
double reach_mm(const PressRings& press, double depth_mm) {
  const double g = std::clamp(depth_mm, 0.0, press.ball_radius_mm);
  const double cut = std::sqrt(g * (2 * press.ball_radius_mm - g));
  return kSureOfSeen * std::clamp(kContactOfCut * cut, 0.5 * press.seen_mm, press.seen_mm);
}

SagProfile within(const PressRings& press, double reach) {
  SagProfile inner = press.all;
  const double limit = sag_mm(press.ball_radius_mm, reach);
  std::erase_if(inner.rings, [limit](const auto& ring) { return !(ring.sag_mm < limit); });
  return inner;
}

}  // namespace

double gain_at(const std::vector<double>& gain, const std::vector<double>& place) {
  constexpr double kMin = 0.1;
  return std::max(kMin, std::inner_product(gain.begin(), gain.end(), place.begin(), 1.0));
}

ChainFit fit_chain(const std::vector<SagProfile>& presses) {
  const std::size_t terms = presses.empty() ? 0 : presses.front().place.size();
  ChainFit fit = solve_once(presses, std::vector<double>(terms), nullptr);
  for (int round = 0; terms > 0 && round < kGainRounds; ++round) {
    fit = solve_once(presses, fit.gain, &fit);
    fit = solve_once(presses, fit.gain, nullptr);
  }
  fit.gaps = gaps_of(presses, fit);
  return fit;
}

std::vector<double> gain_terms(const SettledPress& press, int terms) {
  const double x = (press.contact.col - 0.5 * (press.map.width - 1)) * press.map.mm_per_px;
  const double y = (press.contact.row - 0.5 * (press.map.height - 1)) * press.map.mm_per_px;
  const std::array<double, 5> all{x, y, x * x, x * y, y * y};
  return {all.begin(), all.begin() + terms};
}

PressRings rings_of(const SettledPress& press, std::optional<double> depth_mm, int terms) {
  PressRings out{.all = {.rings = {}, .depth_mm = depth_mm, .place = gain_terms(press, terms)},
                 .seen_mm = press.contact.radius_mm,
                 .ball_radius_mm = press.contact.ball_radius_mm};
  const double step = press.map.mm_per_px;
  auto& rings = out.all.rings;
  rings.resize(static_cast<std::size_t>(std::max(1.0, std::ceil(out.seen_mm / step))));
  for (int y = 0; y < press.map.height; ++y) {
    for (int x = 0; x < press.map.width; ++x) {
      const double r = distance_mm(press.map, press.contact, x, y);
      const double level = press.map.at(x, y);
      if (!(r < out.seen_mm) || std::isnan(level)) continue;
      auto& ring = rings[static_cast<std::size_t>(r / step)];
      ring.level += level;
      ring.sag_mm += sag_mm(out.ball_radius_mm, r);
      ring.weight += 1;
    }
  }
  std::erase_if(rings, [](const auto& ring) { return ring.weight == 0; });
  for (auto& ring : rings) {
    ring.level /= ring.weight;
    ring.sag_mm /= ring.weight;
  }
  return out;
}

PressChain chain_presses(const std::vector<PressRings>& presses) {
  PressChain chain;
  for (const PressRings& press : presses) {
    chain.sure.push_back(within(press, kSureOfSeen * press.seen_mm));
  }
  for (int round = 0; round < kChainRounds; ++round) {
    chain.fit = fit_chain(chain.sure);
    if (round + 1 == kChainRounds) break;
    for (std::size_t p = 0; p < presses.size(); ++p) {
      chain.sure[p] = within(presses[p], reach_mm(presses[p], chain.fit.depth_mm[p]));
    }
  }
  return chain;
}

double LeftOutResidual::mean_error_mm() const {
  double sum = 0;
  double weight = 0;
  for (const Ring& ring : rings) {
    sum += std::abs(ring.error_mm) * ring.weight;
    weight += ring.weight;
  }
  return weight > 0 ? sum / weight : std::numeric_limits<double>::quiet_NaN();
}

LeftOutResidual residual_of(const PressRings& press, const ChainFit& lut) {
  const double gain = gain_at(lut.gain, press.all.place);
  LeftOutResidual residuals;
  double reach = kSureOfSeen * press.seen_mm;
  for (int round = 0; round < kChainRounds; ++round) {
    residuals.rings.clear();
    double depth_mm = 0;
    double weight = 0;
    for (const auto& ring : within(press, reach).rings) {
      const double level = gain * ring.level;
      // The LUT is not used beyond the other presses' levels.
      if (level > lut.knots.back().level) continue;
      const double read = interpolate(lut.knots, std::max(0.0, level));
      residuals.rings.push_back({-ring.sag_mm, read + ring.sag_mm, ring.weight});
      depth_mm += ring.weight * (read + ring.sag_mm);
      weight += ring.weight;
    }
    if (weight == 0) return residuals;
    depth_mm = press.all.depth_mm.value_or(depth_mm / weight);
    for (LeftOutResidual::Ring& ring : residuals.rings) {
      ring.depth_mm += depth_mm;
      ring.error_mm -= depth_mm;
    }
    reach = reach_mm(press, depth_mm);
  }
  return residuals;
}

LeaveOneOut leave_one_out(const std::vector<PressRings>& presses) {
  LeaveOneOut out;
  for (std::size_t left = 0; left < presses.size(); ++left) {
    std::vector<PressRings> others = presses;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(left));
    out.without.push_back(chain_presses(others).fit);
    out.residuals.push_back(residual_of(presses[left], out.without.back()));
  }
  return out;
}

}  // namespace dtact::calibration
