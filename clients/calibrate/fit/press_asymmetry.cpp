#include "clients/calibrate/fit/press_asymmetry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/calibrate/fit/least_squares.hpp"

namespace dtact::calibration {
namespace {

constexpr double kApartMm = 0.1;          // smoothing of the map
constexpr double kKnotLevels = 3;         // grey levels from knot to knot
constexpr double kStraight = 0.3;         // weight of a knot's bend, in shares of all samples
constexpr double kMinImprovement = 5e-4;  // mm
constexpr double kImprovement = 0.05;     // of the left-out error
/// The residual of a real press is correlated over half a millimetre and more, so that a contact
/// has about this number of independent samples.
constexpr double kIndependent = 30;
/// Expected deviation of middle and factors from zero: the middle is the centroid, off by at most a
/// tenth of a millimetre when the light falls by 5 % a millimetre; a plane of 3 % a millimetre is
/// more than any light here has. A quadratic of 2 % a square millimetre is an eighth on the rim.
constexpr double kMiddleMm = 0.1;
constexpr std::array<double, 4> kFactors = {0.03, 0.03, 0.02, 0.02};
constexpr int kRounds = 8;
constexpr std::size_t kFewest = 200;

Eigen::Index terms_of(AsymmetryOrder order) { return 2 * static_cast<Eigen::Index>(order); }

std::array<double, 4> terms_at(double x, double y) { return {x, y, x * x - y * y, 2 * x * y}; }

/// A press's gain with the LUT fitted together with it, as indentation less the press's depth.
struct Fit {
  PressAsymmetry gain;
  Eigen::VectorXd knots;  ///< kKnotLevels apart, the first at no darkening.

  /// Depth by the LUT; extrapolated from the last two knots.
  [[nodiscard]] double depth_at(double level) const { return value_at(knots, level / kKnotLevels); }
  [[nodiscard]] double slope_at(double level) const {
    return (depth_at(level + kKnotLevels) - depth_at(level - kKnotLevels)) / (2 * kKnotLevels);
  }
};

double darkening(const PressAsymmetry& gain, const PressSample& s) {
  return std::max(0.0, gain.at(s.x_mm, s.y_mm) * s.level);
}

/// LUT minus sphere, without the press's depth.
double error_of(const Fit& fit, const PressSample& s, double ball) {
  const double r = std::hypot(s.x_mm - fit.gain.right_mm, s.y_mm - fit.gain.down_mm);
  return fit.depth_at(darkening(fit.gain, s)) + sag_mm(ball, r);
}

/// One iteration: solves the knots, and moves gain and middle along their slopes at `before`.
Fit solve(std::span<const PressSample> samples, double ball, const Fit* before,
          const PressAsymmetry& start, double mean_square) {
  const auto terms = before == nullptr ? 0 : terms_of(start.order);
  const auto middle = terms > 0 ? 2 : 0;  // without a gain the middle alone gains nothing
  double deepest = kKnotLevels;
  for (const PressSample& s : samples) deepest = std::max(deepest, darkening(start, s));
  const auto knots = static_cast<Eigen::Index>(std::ceil(deepest / kKnotLevels)) + 1;
  LeastSquares squares(knots + terms + middle);
  std::vector<LeastSquares::Term> row;
  for (const PressSample& s : samples) {
    const double level = darkening(start, s);
    const auto [below, part] = between_knots(level / kKnotLevels, knots);
    row = {{below, 1 - part}, {below + 1, part}};
    const double dx = s.x_mm - start.right_mm;
    const double dy = s.y_mm - start.down_mm;
    const double r = std::hypot(dx, dy);
    double value = -sag_mm(ball, r);
    const auto along = [&](Eigen::Index unknown, double slope, double now) {
      row.push_back({unknown, slope});
      value += slope * now;
    };
    const std::array<double, 4> place = terms_at(s.x_mm, s.y_mm);
    for (Eigen::Index t = 0; t < terms; ++t) {
      const auto term = static_cast<std::size_t>(t);
      along(knots + t, before->slope_at(level) * s.level * place[term], start.factors[term]);
    }
    if (middle > 0) {
      const double height = std::sqrt(std::max(0.01 * ball * ball, ball * ball - r * r));
      along(knots + terms, -dx / height, start.right_mm);
      along(knots + terms + 1, -dy / height, start.down_mm);
    }
    squares.add(row, value, 1);
  }
  const auto count = static_cast<double>(samples.size());
  squares.straighten(0, knots, kStraight * count);
  const double expected = count / kIndependent * mean_square;
  for (Eigen::Index t = 0; t < terms; ++t) {
    const double factor = kFactors[static_cast<std::size_t>(t)];
    squares.add({{knots + t, 1}}, 0, expected / (factor * factor));
  }
  for (Eigen::Index m = 0; m < middle; ++m) {
    squares.add({{knots + terms + m, 1}}, 0, expected / (kMiddleMm * kMiddleMm));
  }
  const Eigen::VectorXd found = squares.solve();
  Fit fit{start, found.head(knots)};
  for (Eigen::Index t = 0; t < terms; ++t) {
    fit.gain.factors[static_cast<std::size_t>(t)] = found(knots + t);
  }
  if (middle > 0) {
    fit.gain.right_mm = found(knots + terms);
    fit.gain.down_mm = found(knots + terms + 1);
  }
  return fit;
}

Fit fit_jointly(std::span<const PressSample> samples, double ball, AsymmetryOrder order) {
  const auto count = static_cast<double>(samples.size());
  Fit fit = solve(samples, ball, nullptr, {.order = order}, 0);
  for (int round = 0; round < kRounds; ++round) {
    double squares = 0;
    for (const PressSample& s : samples) squares += std::pow(error_of(fit, s, ball), 2);
    fit = solve(samples, ball, &fit, fit.gain, squares / count);
  }
  return fit;
}

/// The mean distance from the errors' median, because the press's depth is not measured.
double mean_error(const Fit& fit, std::span<const PressSample> samples, double ball) {
  std::vector<double> errors;
  errors.reserve(samples.size());
  for (const PressSample& s : samples) errors.push_back(error_of(fit, s, ball));
  if (errors.empty()) return 0;
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::ranges::nth_element(errors, middle);
  const double median = *middle;
  double sum = 0;
  for (const double error : errors) sum += std::abs(error - median);
  return sum / static_cast<double>(errors.size());
}

double left_out_error(std::span<const PressSample> samples, double ball, AsymmetryOrder order,
                      double sector_deg) {
  double sum = 0;
  for (const double turned : {0.0, sector_deg / 2}) {
    std::array<std::vector<PressSample>, 2> parts;
    for (const PressSample& s : samples) {
      parts[in_even_sector(s.x_mm, s.y_mm, sector_deg, turned) ? 0 : 1].push_back(s);
    }
    for (const int fitted : {0, 1}) {
      const auto& judged = parts[static_cast<std::size_t>(1 - fitted)];
      sum += mean_error(fit_jointly(parts[static_cast<std::size_t>(fitted)], ball, order), judged,
                        ball);
    }
  }
  return sum / 4;
}

}  // namespace

double PressAsymmetry::at(double x_mm, double y_mm) const noexcept {
  const std::array<double, 4> terms = terms_at(x_mm, y_mm);
  double gain = 1;
  for (std::size_t t = 0; t < terms.size(); ++t) gain += factors[t] * terms[t];
  return gain;
}

std::vector<PressSample> sure_samples(const DarkeningMap& map, const Contact& contact,
                                      const PixelFilter& use) {
  const int step = std::max(1, static_cast<int>(std::lround(kApartMm / map.mm_per_px)));
  std::vector<PressSample> samples;
  for (int y = 0; y < map.height; y += step) {
    for (int x = 0; x < map.width; x += step) {
      if (distance_mm(map, contact, x, y) >= kSureOfContact * contact.radius_mm) continue;
      if (std::isnan(map.at(x, y)) || (use && !use(x, y))) continue;
      samples.push_back(
          {(x - contact.col) * map.mm_per_px, (y - contact.row) * map.mm_per_px, map.at(x, y)});
    }
  }
  return samples;
}

PressAsymmetry fit_asymmetry(std::span<const PressSample> samples, double ball_radius_mm,
                             AsymmetryOrder order) {
  return fit_jointly(samples, ball_radius_mm, order).gain;
}

ChosenAsymmetry choose_asymmetry(std::span<const PressSample> samples, double ball_radius_mm,
                                 double sector_deg) {
  ChosenAsymmetry chosen;
  if (samples.size() < kFewest) return chosen;
  auto& left_out_mm = chosen.left_out_mm.emplace();
  auto best = AsymmetryOrder::none;
  double least = 0;
  for (const AsymmetryOrder order :
       {AsymmetryOrder::none, AsymmetryOrder::plane, AsymmetryOrder::quadratic}) {
    const double error = left_out_error(samples, ball_radius_mm, order, sector_deg);
    left_out_mm[static_cast<std::size_t>(order)] = error;
    if (order != AsymmetryOrder::none &&
        error > least - std::max(kMinImprovement, kImprovement * least)) {
      continue;
    }
    best = order;
    least = error;
  }
  chosen.gain = fit_asymmetry(samples, ball_radius_mm, best);
  return chosen;
}

std::string ChosenAsymmetry::describe() const {
  if (!left_out_mm) return "press: its contact is too small to tell a gain of its own: it has none";
  std::string text = fmt::format(
      "press: sectors that were left out are {:.4f} mm off the sphere with no gain of its own, "
      "{:.4f} with a plane, {:.4f} with a quadratic: ",
      (*left_out_mm)[0], (*left_out_mm)[1], (*left_out_mm)[2]);
  if (gain.order == AsymmetryOrder::none) return text + "it has none";
  const double tilt = 100 * std::hypot(gain.factors[0], gain.factors[1]);
  text += fmt::format("a plane of {:.1f} % a mm", tilt);
  if (gain.order == AsymmetryOrder::quadratic) {
    text += fmt::format(" and a quadratic of {:.1f} % a mm²",
                        100 * std::hypot(gain.factors[2], gain.factors[3]));
  }
  return text +
         " was taken off this press before its LUT was fitted, and is not part of the "
         "calibration; whether it belongs to the sensor only several presses tell";
}

bool in_even_sector(double x_mm, double y_mm, double sector_deg, double turned_deg) noexcept {
  const double degrees = std::atan2(y_mm, x_mm) * 180 / std::numbers::pi + 360 - turned_deg;
  return static_cast<int>(degrees / sector_deg) % 2 == 0;
}

SymmetricPress without_asymmetry(const DarkeningMap& map, const Contact& contact,
                                 const PressAsymmetry& gain) {
  SymmetricPress press{map, contact};
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double r = std::max(1e-9, distance_mm(map, contact, x, y));
      const double held = map.mm_per_px * std::min(1.0, contact.radius_mm / r);
      press.map.levels[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) +
                       static_cast<std::size_t>(x)] *=
          static_cast<float>(gain.at(held * (x - contact.col), held * (y - contact.row)));
    }
  }
  press.contact.col += gain.right_mm / map.mm_per_px;
  press.contact.row += gain.down_mm / map.mm_per_px;
  return press;
}

}  // namespace dtact::calibration
