#include "daemon/calibration/chain_fit.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>

namespace dtact::calibration {
namespace {

constexpr double kKnotLevels = 2;  // grey levels from knot to knot
/// Weight of a bend of one millimetre between three knots, against all pixels off by a millimetre.
/// Light scattered in from beyond the contact makes the slope that one press shows depend on how
/// wide its contact is, which the presses together would answer with bends that the layer hasn't.
/// With a faint penalty (30 pixels' weight) the list came out steep and a 5 mm ball read 0.037 mm
/// off, with this one 0.017 mm (simulated sensor, layer of 2 mm, six lights).
constexpr double kStraight = 0.1;
/// Weight of a measured depth, in pixels.
constexpr double kMeasured = 1e5;

/// Rows of a least-squares problem added into its normal equations.
class Normal {
 public:
  explicit Normal(int unknowns)
      : matrix_(cv::Mat::zeros(unknowns, unknowns, CV_64F)),
        right_(cv::Mat::zeros(unknowns, 1, CV_64F)) {}

  struct Term {
    int unknown = 0;
    double factor = 0;
  };
  /// Σ factor · unknown = value.
  void add(std::initializer_list<Term> terms, double value, double weight) {
    for (const Term& a : terms) {
      if (a.factor == 0) continue;
      right_.at<double>(a.unknown) += weight * a.factor * value;
      for (const Term& b : terms) {
        matrix_.at<double>(a.unknown, b.unknown) += weight * a.factor * b.factor;
      }
    }
  }
  [[nodiscard]] cv::Mat solve() const {
    cv::Mat x;
    cv::solve(matrix_, right_, x, cv::DECOMP_SVD);
    return x;
  }

 private:
  cv::Mat matrix_;
  cv::Mat right_;
};

double deepest_level(const std::vector<SagProfile>& presses) {
  double deepest = 0;
  for (const SagProfile& press : presses) {
    for (const auto& ring : press.rings) deepest = std::max(deepest, ring.level);
  }
  return deepest;
}

/// What is shown of the list, as intervals of indentation, and what is not in between.
std::vector<ChainFit::Gap> gaps_of(const std::vector<SagProfile>& presses,
                                   const std::vector<Knot>& knots) {
  std::vector<ChainFit::Gap> shown;
  for (const SagProfile& press : presses) {
    if (press.rings.empty()) continue;
    const auto [least, most] = std::ranges::minmax(press.rings, {}, &SagProfile::Ring::level);
    shown.push_back({interpolate(knots, std::max(0.0, least.level)),
                     interpolate(knots, std::max(0.0, most.level))});
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

}  // namespace

ChainFit fit_chain(const std::vector<SagProfile>& presses) {
  const double deepest = deepest_level(presses);
  if (!(deepest > 0)) throw std::invalid_argument("no ring of any press is darker than untouched");
  const int knots = std::max(2, static_cast<int>(std::ceil(deepest / kKnotLevels)));
  const double step = deepest / knots;
  // Unknowns: the knots 1 … n (knot 0 is zero), then the presses' depths.
  const auto unknown = [](int knot) { return knot - 1; };
  Normal normal(knots + static_cast<int>(presses.size()));
  for (std::size_t p = 0; p < presses.size(); ++p) {
    const int depth = knots + static_cast<int>(p);
    for (const auto& ring : presses[p].rings) {
      const double place = std::max(0.0, ring.level) / step;
      const int below = std::min(knots - 1, static_cast<int>(place));
      const double part = place - below;
      const Normal::Term upper{unknown(below + 1), part};
      if (below == 0) {
        normal.add({upper, {depth, -1}}, -ring.sag_mm, ring.weight);
      } else {
        normal.add({{unknown(below), 1 - part}, upper, {depth, -1}}, -ring.sag_mm, ring.weight);
      }
    }
    const std::optional<double>& measured = presses[p].depth_mm;
    if (measured) normal.add({{depth, 1}}, *measured, kMeasured);
  }
  double straight = 0;
  for (const SagProfile& press : presses) {
    for (const auto& ring : press.rings) straight += kStraight * ring.weight;
  }
  for (int knot = 1; knot < knots; ++knot) {
    if (knot == 1) {
      normal.add({{unknown(1), -2}, {unknown(2), 1}}, 0, straight);
    } else {
      normal.add({{unknown(knot - 1), 1}, {unknown(knot), -2}, {unknown(knot + 1), 1}}, 0,
                 straight);
    }
  }
  const cv::Mat x = normal.solve();

  ChainFit fit;
  double risen = 0;
  for (int knot = 1; knot <= knots; ++knot) {
    risen = std::max(risen, x.at<double>(unknown(knot)));
    fit.knots.push_back({knot * step, risen, 1});
  }
  for (std::size_t p = 0; p < presses.size(); ++p) {
    fit.depth_mm.push_back(x.at<double>(knots + static_cast<int>(p)));
  }
  fit.gaps = gaps_of(presses, fit.knots);
  return fit;
}

}  // namespace dtact::calibration
