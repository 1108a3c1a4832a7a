#include "clients/calibrate/fit/lut_fit.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace dtact::calibration {
namespace {

constexpr double kTrustedLevels = 2;  // grey levels beyond the greatest one seen

double bulge_mm(double level, double slope, double c) {
  return -c * (1 - std::exp(slope * level / c));
}

/// The c at which dent and bulge have the same volume, from a radial profile, so that a
/// ring that the image cuts off counts as whole.
double bulge_limit(const RadialProfile& profile, const std::vector<Knot>& knots, double slope) {
  const auto volume = [&](double c) {
    double sum = 0;
    for (std::size_t i = 0; i < profile.levels.size(); ++i) {
      const double level = profile.levels[i];
      if (std::isnan(level)) continue;
      const double depth = level > 0 ? interpolate(knots, level) : bulge_mm(level, slope, c);
      sum += depth * (2 * static_cast<double>(i) + 1);
    }
    return sum;
  };
  // From a bulge that hardly rises to a straight LUT; a greater c gives more bulge.
  double low = 0.02;
  double high = 10;
  for (int i = 0; i < 50; ++i) {
    const double middle = std::sqrt(low * high);
    (volume(middle) > 0 ? low : high) = middle;
  }
  return low;
}

constexpr double kBinsPerLevel = 2;  // in the monotone fit
constexpr int kFewest = 4;           // pixels that a grey level needs to count
constexpr std::size_t kRange = 256;  // grey levels

/// Means of (level, sag) over pixels within `reach_mm` of the centre, `per_level` bins a level.
std::vector<Knot> sag_by_level(const DarkeningMap& map, const Contact& contact,
                               const PixelFilter& use, double reach_mm, double per_level) {
  std::vector<Knot> bins(static_cast<std::size_t>(static_cast<double>(kRange) * per_level));
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double r = distance_mm(map, contact, x, y);
      const double level = map.at(x, y);
      // A press's own gain may raise a level above all that a picture can have.
      const bool in_range = level >= 0 && level < static_cast<double>(kRange);
      if (r >= reach_mm || !in_range || (use && !use(x, y))) continue;
      Knot& bin = bins[static_cast<std::size_t>(level * per_level)];
      bin.level += level;
      bin.depth_mm += sag_mm(contact.ball_radius_mm, r);
      bin.weight += 1;
    }
  }
  std::erase_if(bins, [](const Knot& bin) { return bin.weight < kFewest; });
  for (Knot& bin : bins) {
    bin.level /= bin.weight;
    bin.depth_mm /= bin.weight;
  }
  return bins;
}

SagFit fit_line(const std::vector<Knot>& bins) {
  double n = 0;
  double x = 0;
  double y = 0;
  double xx = 0;
  double xy = 0;
  for (const Knot& bin : bins) {
    n += 1;
    x += bin.level;
    y += bin.depth_mm;
    xx += bin.level * bin.level;
    xy += bin.level * bin.depth_mm;
  }
  const double spread = n * xx - x * x;
  const double slope = spread > 0 ? -(n * xy - x * y) / spread : 0;
  if (bins.size() < 4 || !(slope > 0)) {
    throw std::runtime_error(
        "the image does not darken steadily from the contact's edge to its centre; the ball's "
        "radius or the scale may be wrong, or the press was too light");
  }
  return {(y + slope * x) / n, slope};
}

/// Step 2: pool adjacent violators (Ayer et al. 1955), weighted.
void make_monotone(std::vector<Knot>& knots) {
  std::vector<Knot> pools(knots.size());
  std::vector<std::size_t> members(knots.size());
  std::size_t used = 0;
  for (const Knot& knot : knots) {
    pools[used] = knot;
    members[used++] = 1;
    while (used > 1 && pools[used - 2].depth_mm > pools[used - 1].depth_mm) {
      const Knot& last = pools[--used];
      Knot& pool = pools[used - 1];
      const double weight = pool.weight + last.weight;
      pool.depth_mm = (pool.depth_mm * pool.weight + last.depth_mm * last.weight) / weight;
      pool.weight = weight;
      members[used - 1] += members[used];
    }
  }
  std::size_t i = 0;
  for (std::size_t pool = 0; pool < used; ++pool) {
    for (std::size_t k = 0; k < members[pool]; ++k) knots[i++].depth_mm = pools[pool].depth_mm;
  }
}

/// Step 3. Returns the slope at zero, millimetres a grey level: that of the line to the origin, but
/// within a factor of four of the contact's own, in case an asymmetric press has its edge at zero.
double hand_over(std::vector<Knot>& knots, double sure_level, double line_slope) {
  const double slope =
      std::clamp(interpolate(knots, sure_level) / sure_level, line_slope / 4, line_slope * 4);
  for (Knot& knot : knots) {
    if (knot.level >= sure_level) break;
    knot.depth_mm = std::lerp(slope * knot.level, knot.depth_mm, knot.level / sure_level);
  }
  double deepest = 0;
  for (Knot& knot : knots) knot.depth_mm = deepest = std::max(deepest, knot.depth_mm);
  return slope;
}

}  // namespace

double interpolate(const std::vector<Knot>& knots, double level) {
  const auto above = std::ranges::lower_bound(knots, level, {}, &Knot::level);
  if (above == knots.end()) return knots.back().depth_mm;
  const Knot below = above == knots.begin() ? Knot{} : *(above - 1);
  return std::lerp(below.depth_mm, above->depth_mm,
                   (level - below.level) / (above->level - below.level));
}

recon::DepthLut make_lut(const std::vector<Knot>& knots, double slope_at_zero, double slope_beyond,
                         const RadialProfile& profile) {
  const double c = bulge_limit(profile, knots, slope_at_zero);
  const Knot deepest = knots.back();
  const double faintest = std::ranges::min(
      profile.levels, {}, [](double level) { return std::isnan(level) ? 0 : level; });

  recon::DepthLut lut;
  constexpr int kStep = recon::kEntriesPerLevel;
  lut.first_q6 = kLutFirstLevel * kStep;
  for (int q6 = kLutFirstLevel * kStep; q6 <= kLutLastLevel * kStep; ++q6) {
    const double level = static_cast<double>(q6) / kStep;
    double mm = 0;
    if (level <= 0) {
      mm = bulge_mm(level, slope_at_zero, c);
    } else if (level <= deepest.level) {
      mm = interpolate(knots, level);
    } else {
      mm = deepest.depth_mm + slope_beyond * (level - deepest.level);
    }
    lut.um.push_back(
        static_cast<std::int16_t>(std::clamp(std::lround(1000 * mm), -16383L, 16383L)));
  }
  const auto covered = [](double level) {
    return static_cast<int>(
        std::lround(kStep * std::clamp<double>(level, kLutFirstLevel, kLutLastLevel)));
  };
  lut.covered_from_q6 = covered(std::min(faintest, 0.0));
  lut.covered_to_q6 = covered(deepest.level + kTrustedLevels);
  return lut;
}

double lut_mm(const recon::DepthLut& lut, double level) {
  const long entry = std::lround(level * recon::kEntriesPerLevel) - lut.first_q6;
  const long last = static_cast<long>(lut.um.size()) - 1;
  return 0.001 * lut.um[static_cast<std::size_t>(std::clamp(entry, 0L, last))];
}

double slope_mm(const recon::DepthLut& lut) {
  constexpr double kLevels = 20;
  const double covered = static_cast<double>(lut.covered_to_q6) / recon::kEntriesPerLevel;
  const double level = std::clamp(covered, 1.0, kLevels);
  return lut_mm(lut, level) / level;
}

SagFit fit_sag(const DarkeningMap& map, const Contact& contact, const PixelFilter& use) {
  return fit_line(sag_by_level(map, contact, use, kSureOfContact * contact.radius_mm, 1));
}

recon::DepthLut fit_lut(const DarkeningMap& map, const Contact& contact, const PixelFilter& use,
                        std::optional<double> depth_mm) {
  const double sure_mm = kSureOfContact * contact.radius_mm;
  const SagFit line = fit_sag(map, contact, use);
  std::vector<Knot> knots = sag_by_level(map, contact, use, contact.radius_mm, kBinsPerLevel);
  for (Knot& knot : knots) {
    knot.depth_mm = depth_mm.value_or(line.depth_mm) - knot.depth_mm;
  }
  make_monotone(knots);

  const RadialProfile profile = radial_profile(map, contact, kFarField * contact.ball_radius_mm);
  const double slope = hand_over(knots, std::max(1.0, profile.at(sure_mm)), line.slope);
  return make_lut(knots, slope, line.slope, profile);
}

}  // namespace dtact::calibration
