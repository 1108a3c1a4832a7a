#include "clients/calibrate/fit/model/model_lut.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/fit/least_squares.hpp"
#include "clients/calibrate/fit/lut_fit.hpp"
#include "clients/calibrate/fit/lut_uncertainty.hpp"
#include "clients/calibrate/fit/model/radial_transform.hpp"

namespace dtact::calibration {
namespace {

constexpr std::array<double, 7> kBalls = {1.5, 2, 3, 4, 5, 6, 8};  // mm
constexpr int kDepths = 8;
/// Beyond it the linear gel does not describe a real one, and the response is unknown.
constexpr double kMaxGelShare = 0.92;
constexpr double kKnotLevels = 2;
constexpr double kTrustedBeyond = 2;  // grey levels
constexpr int kDraws = 20;

/// A ball in the maps of all LUTs, on RadialTransform's grid.
struct Shown {
  Eigen::VectorXd indentation_mm;
  std::array<Eigen::VectorXd, kLuts> levels;
  double ball_radius_mm = 0;
  double contact_radius_mm = 0;
};

/// The factor of each LUT's map on every wave number of a loss. The filter may assume another
/// scattering than the gel's.
std::array<Eigen::VectorXd, kLuts> transfers(const recon::Scattering& scattering,
                                             const recon::Scattering& believed,
                                             const MapOptics& optics) {
  std::array<Eigen::VectorXd, kLuts> transfers;
  const Eigen::VectorXd seen =
      optics.light_levels * scattered(scattering).cwiseProduct(blurred(optics.smoothing_mm));
  const Eigen::VectorXd back = scattered(believed);
  for (int steps = 0; steps < kLuts; ++steps) {
    transfers[static_cast<std::size_t>(steps)] = seen.cwiseProduct(sharpened(back, steps));
  }
  return transfers;
}

Shown show(const GelModel& gel, const BallContact& contact,
           const std::array<Eigen::VectorXd, kLuts>& light) {
  PredictedPress press = predict_press(gel, contact);
  Shown shown{
      std::move(press.indentation_mm), {}, contact.ball_radius_mm, contact.contact_radius_mm};
  for (std::size_t i = 0; i < light.size(); ++i) {
    shown.levels[i] = RadialTransform::instance().values(press.spectrum.cwiseProduct(light[i]));
  }
  return shown;
}

/// Computes balls of every size at every depth on a gel.
std::vector<Shown> show_balls(const GelModel& gel, const MapOptics& optics, double deepest_mm) {
  const auto light = transfers(gel.scattering, gel.scattering, optics);
  std::vector<Shown> balls;
  for (const double radius : kBalls) {
    const double most = std::min({deepest_mm, kMaxGelShare * gel.thickness_mm, 0.75 * radius});
    for (int i = 1; i <= kDepths; ++i) {
      balls.push_back(
          show(gel, press_ball_to(radius, most * i / kDepths, gel.thickness_mm), light));
    }
  }
  return balls;
}

/// Calls `add(level, indentation, weight)` for the points of a ball that make a LUT: the
/// contact, and the bulge around. Every point has the same weight.
template <typename Add>
void for_places(const Shown& ball, std::size_t lut, const Add& add) {
  const Eigen::VectorXd& levels = ball.levels[lut];
  const double a = ball.contact_radius_mm;
  for (Eigen::Index i = 0; i < RadialTransform::kPoints; ++i) {
    const double r = RadialTransform::kStepMm * static_cast<double>(i);
    const bool in_contact = r <= a;
    if (!in_contact && (levels[i] >= 0 || r > 4 * a)) continue;
    add(levels[i], ball.indentation_mm[i], r);
  }
}

struct Knots {
  int first = 0;  ///< Index; the knot is at `first`·kKnotLevels.
  Eigen::VectorXd depth_mm;

  [[nodiscard]] double at(double level) const {
    return value_at(depth_mm, level / kKnotLevels - first);
  }
};

/// Straight lines between knots by least squares, zero at zero, kept straight where few points are,
/// rising.
Knots fit_knots(const std::vector<Shown>& balls, std::size_t lut) {
  double low = 0;
  double high = 0;
  for (const Shown& ball : balls) {
    for_places(ball, lut, [&](double level, double, double) {
      low = std::min(low, level);
      high = std::max(high, level);
    });
  }
  Knots knots;
  knots.first = std::min(-1, static_cast<int>(std::floor(low / kKnotLevels)));
  const int last = std::max(2, static_cast<int>(std::ceil(high / kKnotLevels)));
  const Eigen::Index count = last - knots.first + 1;
  const Eigen::Index zero = -knots.first;
  LeastSquares squares(count);
  for (const Shown& ball : balls) {
    for_places(ball, lut, [&](double level, double depth, double weight) {
      const auto [below, part] = between_knots(level / kKnotLevels - knots.first, count);
      squares.add({{below, 1 - part}, {below + 1, part}}, depth, weight);
    });
  }
  // The gel responds differently on either side of zero.
  const double stiff = 0.02 * squares.trace() / static_cast<double>(count);
  squares.straighten(0, zero + 1, stiff);
  squares.straighten(zero, count - zero, stiff);
  squares.add({{zero, 1}}, 0, 1e6 * squares.trace());  // depth 0
  knots.depth_mm = squares.solve();
  knots.depth_mm[zero] = 0;
  for (Eigen::Index i = zero + 1; i < count; ++i) {
    knots.depth_mm[i] = std::max(knots.depth_mm[i], knots.depth_mm[i - 1]);
  }
  for (Eigen::Index i = zero; i-- > 0;) {
    knots.depth_mm[i] = std::min(knots.depth_mm[i], knots.depth_mm[i + 1]);
  }
  return knots;
}

recon::DepthLut tabulate(const Knots& knots, double deepest_mm) {
  constexpr int kFirst = kLutFirstLevel * recon::kEntriesPerLevel;
  constexpr int kLast = kLutLastLevel * recon::kEntriesPerLevel;
  const double low = knots.first * kKnotLevels;
  const double high = low + static_cast<double>(knots.depth_mm.size() - 1) * kKnotLevels;
  recon::DepthLut lut{kFirst, {}, 0, 0};
  lut.covered_from_q6 =
      std::max(kFirst, static_cast<int>(std::lround(low * recon::kEntriesPerLevel)));
  for (int q6 = kFirst; q6 <= kLast; ++q6) {
    const double level = static_cast<double>(q6) / recon::kEntriesPerLevel;
    const double depth_mm = knots.at(std::max(level, low));
    lut.um.push_back(
        static_cast<std::int16_t>(std::lround(std::clamp(1000 * depth_mm, -16383.0, 16383.0))));
    if (level <= high && depth_mm <= deepest_mm) lut.covered_to_q6 = q6;
  }
  lut.covered_to_q6 = std::min(
      kLast, lut.covered_to_q6 + static_cast<int>(kTrustedBeyond * recon::kEntriesPerLevel));
  return lut;
}

/// Standard deviation of a frame's noise in the map, grey levels: white noise through the transfer
/// function, σ²·px²/2π·∫|T|² k dk.
double noise_levels(const GelModel& gel, const MapOptics& optics, int steps) {
  const Eigen::VectorXd& k = RadialTransform::instance().wave_numbers();
  const Eigen::ArrayXd through =
      (blurred(optics.smoothing_mm).array() * sharpened(scattered(gel.scattering), steps).array())
          .square();
  double sum = 0;
  for (Eigen::Index i = 1; i < k.size(); ++i) {
    sum += 0.5 * (k[i] - k[i - 1]) * (through[i] * k[i] + through[i - 1] * k[i - 1]);
  }
  return kFrameNoise * optics.mm_per_px * std::sqrt(sum / (2 * std::numbers::pi));
}

/// Every third ball on gels drawn from the covariance, with contacts as wide as on the fitted one.
std::vector<Shown> show_drawn(const ModelFit& fit, const MapOptics& optics,
                              const std::vector<Shown>& balls) {
  const Eigen::MatrixXd root = fit.covariance.llt().matrixL();
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<Shown> drawn;
  for (int draw = 0; draw < kDraws; ++draw) {
    Eigen::VectorXd steps(fit.parameters.size());
    for (double& step : steps) step = normal(random);
    const GelModel gel = gel_of(fit.parameters + root * steps);
    const auto light = transfers(gel.scattering, fit.gel.scattering, optics);
    for (auto i = static_cast<std::size_t>(draw % 3); i < balls.size(); i += 3) {
      try {
        drawn.push_back(show(
            gel, press_ball(balls[i].ball_radius_mm, balls[i].contact_radius_mm, gel.thickness_mm),
            light));
      } catch (const std::invalid_argument&) {
        continue;  // a gel too far off for this contact
      }
    }
  }
  return drawn;
}

std::vector<recon::Model::Uncertainty> errors_of(const Knots& knots, double noise,
                                                 double deepest_mm, const std::vector<Shown>& balls,
                                                 std::size_t lut) {
  struct Bin {
    double depth = 0;
    double square = 0;
    double weight = 0;
  };
  std::vector<Bin> bins(static_cast<std::size_t>(deepest_mm / kDepthBinMm) + 1);
  for (const Shown& ball : balls) {
    for_places(ball, lut, [&](double level, double depth, double weight) {
      if (depth < 0) return;
      const double error = knots.at(level) - depth;
      const double wobble = 0.5 * (knots.at(level + noise) - knots.at(level - noise));
      Bin& bin = bins[std::min(bins.size() - 1, static_cast<std::size_t>(depth / kDepthBinMm))];
      bin.depth += weight * depth;
      bin.square += weight * (error * error + wobble * wobble);
      bin.weight += weight;
    });
  }
  std::vector<recon::Model::Uncertainty> rows;
  for (const Bin& bin : bins) {
    if (bin.weight == 0) continue;
    rows.push_back({std::round(1000 * bin.depth / bin.weight) / 1000,
                    std::round(1e4 * std::sqrt(bin.square / bin.weight)) / 10});
  }
  return rows;
}

}  // namespace

std::array<recon::DepthLut, kLuts> luts_of(const GelModel& gel, const MapOptics& optics,
                                           double deepest_mm) {
  const std::vector<Shown> balls = show_balls(gel, optics, deepest_mm);
  std::array<recon::DepthLut, kLuts> luts;
  for (std::size_t i = 0; i < luts.size(); ++i) {
    luts[i] = tabulate(fit_knots(balls, i), deepest_mm);
  }
  return luts;
}

std::array<ModelLut, kLuts> luts_of(const ModelFit& fit, const MapOptics& optics) {
  const double deepest = fit.deepest_mm();
  const std::vector<Shown> balls = show_balls(fit.gel, optics, deepest);
  const std::vector<Shown> drawn = show_drawn(fit, optics, balls);
  std::array<ModelLut, kLuts> luts;
  for (std::size_t i = 0; i < luts.size(); ++i) {
    const Knots knots = fit_knots(balls, i);
    const double noise = noise_levels(fit.gel, optics, static_cast<int>(i));
    luts[i] = {tabulate(knots, deepest), errors_of(knots, noise, deepest, drawn, i)};
  }
  return luts;
}

}  // namespace dtact::calibration
