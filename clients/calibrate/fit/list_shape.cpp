#include "clients/calibrate/fit/list_shape.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::calibration {
namespace {

constexpr double kVouched = 2;  // grey levels beyond the greatest one seen

double bulge_mm(double level, double slope, double c) {
  return -c * (1 - std::exp(slope * level / c));
}

/// The c at which dent and bulge have the same volume, from a radial profile, so that a
/// ring that is cut off by the image counts whole.
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
  // From a bulge that hardly rises to a list that is straight; the greater c, the more bulge.
  double low = 0.02;
  double high = 10;
  for (int i = 0; i < 50; ++i) {
    const double middle = std::sqrt(low * high);
    (volume(middle) > 0 ? low : high) = middle;
  }
  return low;
}

}  // namespace

double interpolate(const std::vector<Knot>& knots, double level) {
  const auto above = std::ranges::lower_bound(knots, level, {}, &Knot::level);
  if (above == knots.end()) return knots.back().depth_mm;
  const Knot below = above == knots.begin() ? Knot{} : *(above - 1);
  return std::lerp(below.depth_mm, above->depth_mm,
                   (level - below.level) / (above->level - below.level));
}

recon::DepthList make_list(const std::vector<Knot>& knots, double slope_at_zero,
                           double slope_beyond, const RadialProfile& profile) {
  const double c = bulge_limit(profile, knots, slope_at_zero);
  const Knot deepest = knots.back();
  const double faintest = std::ranges::min(
      profile.levels, {}, [](double level) { return std::isnan(level) ? 0 : level; });

  recon::DepthList list;
  constexpr int kStep = recon::kEntriesPerLevel;
  list.first_q6 = kListFirstLevel * kStep;
  for (int q6 = kListFirstLevel * kStep; q6 <= kListLastLevel * kStep; ++q6) {
    const double level = static_cast<double>(q6) / kStep;
    double mm = 0;
    if (level <= 0) {
      mm = bulge_mm(level, slope_at_zero, c);
    } else if (level <= deepest.level) {
      mm = interpolate(knots, level);
    } else {
      mm = deepest.depth_mm + slope_beyond * (level - deepest.level);
    }
    list.um.push_back(
        static_cast<std::int16_t>(std::clamp(std::lround(1000 * mm), -16383L, 16383L)));
  }
  const auto covered = [](double level) {
    return static_cast<int>(
        std::lround(kStep * std::clamp<double>(level, kListFirstLevel, kListLastLevel)));
  };
  list.covered_from_q6 = covered(std::min(faintest, 0.0));
  list.covered_to_q6 = covered(deepest.level + kVouched);
  return list;
}

double look_up_mm(const recon::DepthList& list, double level) {
  const long entry = std::lround(level * recon::kEntriesPerLevel) - list.first_q6;
  const long last = static_cast<long>(list.um.size()) - 1;
  return 0.001 * list.um[static_cast<std::size_t>(std::clamp(entry, 0L, last))];
}

}  // namespace dtact::calibration
