#include "clients/calibrate/fit/press_chain.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace dtact::calibration {
namespace {

constexpr double kSureOfSeen = 0.6;
constexpr int kChainRounds = 4;  // until the contacts' radii have followed the depths

/// The sure contact's radius for a depth. One that is far off in the first rounds must not empty or
/// flood the contact.
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

double MetPress::mean_error_mm() const {
  double sum = 0;
  double weight = 0;
  for (const Ring& ring : rings) {
    sum += std::abs(ring.error_mm) * ring.weight;
    weight += ring.weight;
  }
  return weight > 0 ? sum / weight : std::numeric_limits<double>::quiet_NaN();
}

MetPress meet(const PressRings& press, const ChainFit& list) {
  const double gain = gain_at(list.gain, press.all.place);
  MetPress met;
  double reach = kSureOfSeen * press.seen_mm;
  for (int round = 0; round < kChainRounds; ++round) {
    met.rings.clear();
    double depth_mm = 0;
    double weight = 0;
    for (const auto& ring : within(press, reach).rings) {
      const double level = gain * ring.level;
      // Beyond what the others show nothing is claimed.
      if (level > list.knots.back().level) continue;
      const double read = interpolate(list.knots, std::max(0.0, level));
      met.rings.push_back({-ring.sag_mm, read + ring.sag_mm, ring.weight});
      depth_mm += ring.weight * (read + ring.sag_mm);
      weight += ring.weight;
    }
    if (weight == 0) return met;
    depth_mm = press.all.depth_mm.value_or(depth_mm / weight);
    for (MetPress::Ring& ring : met.rings) {
      ring.depth_mm += depth_mm;
      ring.error_mm -= depth_mm;
    }
    reach = reach_mm(press, depth_mm);
  }
  return met;
}

LeftOut leave_each_out(const std::vector<PressRings>& presses) {
  LeftOut out;
  for (std::size_t left = 0; left < presses.size(); ++left) {
    std::vector<PressRings> others = presses;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(left));
    out.without.push_back(chain_presses(others).fit);
    out.met.push_back(meet(presses[left], out.without.back()));
  }
  return out;
}

}  // namespace dtact::calibration
