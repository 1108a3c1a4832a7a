#include "clients/calibrate/force/force_fit.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>

namespace dtact::force {
namespace {

constexpr double kMaxError = 0.25;
constexpr double kMinModulus = 0.02;  // MPa
constexpr double kMaxModulus = 2;
constexpr float kContactMm = 0.05F;
constexpr double kZeroMm = 0.03;
constexpr double kThicknessMm = 2;
constexpr double kThicknessSpread = 0.35;

void check(const std::vector<Pair>& pairs) {
  if (pairs.size() < kMinPairs) {
    throw std::invalid_argument(
        fmt::format("{} pairs of contact and reading are too few: at least {}, of light to heavy "
                    "loads",
                    pairs.size(), kMinPairs));
  }
  for (const Pair& pair : pairs) {
    if (pair.contact.cell_mm() != pairs.front().contact.cell_mm() ||
        pair.contact.mm().size() != pairs.front().contact.mm().size()) {
      throw std::invalid_argument(fmt::format(
          "{}: its depth map has another size than that of {}: measure all pairs at one "
          "resolution",
          pair.name, pairs.front().name));
    }
    if (std::ranges::none_of(pair.contact.mm(), [](float mm) { return mm > kContactMm; })) {
      throw std::invalid_argument(
          fmt::format("{}: there is no contact in it: take the pair out, or the picture while the "
                      "scale shows the load",
                      pair.name));
    }
    if (pair.contact.cut_off()) {
      throw std::invalid_argument(fmt::format(
          "{}: the contact reaches the map's edge or pixels that are not trusted: press "
          "nearer to the middle",
          pair.name));
    }
    if (!(pair.newtons > 0)) {
      throw std::invalid_argument(fmt::format(
          "{}: its reading of {} N is not above 0: zero the scale with the sensor on it, and let "
          "a heavier load read more",
          pair.name, pair.newtons));
    }
  }
}

/// The forces of the contacts on a gel of one thickness.
class Readings {
 public:
  Readings(const std::vector<Pair>& pairs, double thickness_mm) : pairs_(pairs) {
    recon::GelResponse response(thickness_mm, pairs.front().contact);
    for (const Pair& pair : pairs) {
      const recon::GelResponse::Answer answer = response.answer(pair.contact);
      rows_.emplace_back(answer.mm2, answer.mm);
    }
  }

  /// Modulus, and modulus times zero. Excludes the pair `left_out`.
  [[nodiscard]] Eigen::Vector2d fit(std::size_t left_out = SIZE_MAX) const {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      if (i == left_out) continue;
      const double weight = 1 / square(tolerance(i));
      normal += weight * rows_[i] * rows_[i].transpose();
      right += weight * pairs_[i].newtons * rows_[i];
    }
    const double modulus = right[0] / normal(0, 0);  // without a zero
    normal(1, 1) += 1 / square(modulus * kZeroMm);
    return normal.llt().solve(right);
  }
  [[nodiscard]] double error(std::size_t i, const Eigen::Vector2d& numbers) const {
    return rows_[i].dot(numbers) - pairs_[i].newtons;
  }
  [[nodiscard]] double cost(const Eigen::Vector2d& numbers) const {
    double sum = square(numbers[1] / numbers[0] / kZeroMm);
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      sum += square(error(i, numbers) / tolerance(i));
    }
    return sum;
  }

 private:
  static double square(double x) { return x * x; }
  [[nodiscard]] double tolerance(std::size_t i) const { return 0.02 * pairs_[i].newtons + 0.005; }

  const std::vector<Pair>& pairs_;
  std::vector<Eigen::Vector2d> rows_;
};

double fitted_thickness(const std::vector<Pair>& pairs) {
  double best = 0;
  double least = std::numeric_limits<double>::infinity();
  constexpr int kSteps = 35;  // from 0.5 to 5 mm
  for (int step = 0; step < kSteps; ++step) {
    const double thickness = 0.5 * std::pow(1.07, step);
    const Readings readings(pairs, thickness);
    const double off = std::log(thickness / kThicknessMm) / kThicknessSpread;
    const double cost = readings.cost(readings.fit()) + off * off;
    if (cost >= least) continue;
    least = cost;
    best = thickness;
  }
  return best;
}

}  // namespace

Fit fit_force(const std::vector<Pair>& pairs, std::optional<double> thickness_mm) {
  check(pairs);
  const double thickness = thickness_mm ? *thickness_mm : fitted_thickness(pairs);
  const Readings readings(pairs, thickness);
  const Eigen::Vector2d numbers = readings.fit();
  const auto [lightest, heaviest] = std::ranges::minmax(pairs, {}, &Pair::newtons);
  Fit fit;
  double share = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    fit.left_out.push_back(readings.error(i, readings.fit(i)));
    // The scale's resolution dominates the error of light readings.
    share += std::abs(fit.left_out.back()) / std::max(pairs[i].newtons, heaviest.newtons / 10) /
             static_cast<double>(pairs.size());
  }
  if (share > kMaxError || !(numbers[0] > 0)) {
    throw std::invalid_argument(fmt::format(
        "pairs that are left out are missed by {:.0f} %: are readings and pictures of the same "
        "moments, and in the same order?",
        100 * share));
  }
  if (numbers[0] < kMinModulus || numbers[0] > kMaxModulus) {
    throw std::invalid_argument(fmt::format(
        "the readings are those of a gel with a modulus of {:.3g} MPa, silicones have {} to {}: "
        "they have to be in newtons ({}), and the calibration's millimetres right",
        numbers[0], kMinModulus, kMaxModulus,
        numbers[0] > kMaxModulus ? "1 g weighs 0.00981 N; --grams takes grams"
                                 : "1 kg weighs 9.81 N"));
  }
  fit.model = {.modulus_mpa = numbers[0],
               .thickness_mm = thickness,
               .zero_mm = numbers[1] / numbers[0],
               .error_share = share,
               .pairs = static_cast<int>(pairs.size()),
               .from_n = lightest.newtons,
               .to_n = heaviest.newtons};
  return fit;
}

}  // namespace dtact::force
