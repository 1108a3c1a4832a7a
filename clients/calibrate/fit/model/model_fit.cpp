#include "clients/calibrate/fit/model/model_fit.hpp"

#include <ceres/crs_matrix.h>
#include <ceres/dynamic_numeric_diff_cost_function.h>
#include <ceres/normal_prior.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "clients/calibrate/fit/model/radial_transform.hpp"

namespace dtact::calibration {
namespace {

using enum ModelFit::Parameter;
enum Own : int { kRadius, kOffset, kOwnCount };

constexpr std::array<double, 3> kStartThicknesses = {1.5, 2, 2.8};
/// Unexplained error of a ring's mean: start value of the fit, and the smallest value that
/// it uses. Shares of the light.
constexpr double kFirstUncertainty = 1e-3;
constexpr double kMinUncertainty = 6e-5;
constexpr int kMaxIterations = 30;

GelModel gel_from(std::span<const double> x) {
  GelModel gel;
  gel.thickness_mm = std::exp(x[kThickness]);
  const double narrow = std::exp(x[kNarrow]);
  const double wide = std::exp(x[kWide]);
  const double weight = 1 / (1 + std::exp(-x[kOdds]));
  gel.scattering = narrow < wide ? recon::Scattering{narrow, wide, weight}
                                 : recon::Scattering{wide, narrow, 1 - weight};
  for (std::size_t i = 0; i < gel.response.slopes.size(); ++i) {
    gel.response.slopes[i] = std::exp(x[kSlopes + i]);
  }
  gel.response.bulge_factor = std::exp(x[kBulge]);
  return gel;
}

/// One press's rings against the model's prediction.
class RingCost {
 public:
  RingCost(const PressProfile& press, double doubt, std::size_t shared)
      : press_(press),
        doubt_(doubt),
        shared_(shared),
        smoothing_(blurred(press.smoothing_mm)),
        to_rings_(RadialTransform::instance().back_to(press.radius_mm)) {}

  bool operator()(const double* const* parameters, double* residuals) const {
    const GelModel gel = gel_from(std::span(parameters[0], shared_));
    const double* own = parameters[1];
    if (!press(std::exp(own[kRadius]), gel)) return false;
    const Eigen::VectorXd seen =
        to_rings_ * spectrum_.cwiseProduct(scattered(gel.scattering)).cwiseProduct(smoothing_);
    for (std::size_t i = 0; i < press_.radius_mm.size(); ++i) {
      residuals[i] = (seen[static_cast<Eigen::Index>(i)] + own[kOffset] - press_.loss[i]) /
                     std::hypot(doubt_, press_.noise[i]);
    }
    return true;
  }

 private:
  /// Solves the contact only when its radius or the thickness moved, and the loss only when
  /// they or the response did: half of the derivatives need neither.
  bool press(double radius_mm, const GelModel& gel) const {
    const bool same_contact = contact_ && contact_->contact_radius_mm == radius_mm &&
                              pressed_.thickness_mm == gel.thickness_mm;
    if (same_contact && pressed_.response == gel.response) return true;
    if (!same_contact) {
      try {
        contact_ = press_ball(press_.ball_radius_mm, radius_mm, gel.thickness_mm);
      } catch (const std::invalid_argument&) {
        contact_.reset();
        return false;
      }
    }
    pressed_ = gel;
    spectrum_ = predict_press(gel, *contact_).spectrum;
    return true;
  }

  const PressProfile& press_;
  double doubt_;
  std::size_t shared_;
  Eigen::VectorXd smoothing_;
  Eigen::MatrixXd to_rings_;
  mutable std::optional<BallContact> contact_;
  mutable GelModel pressed_;
  mutable Eigen::VectorXd spectrum_;
};

/// Rows (x − mean)/deviation, and of differences between slopes.
ceres::CostFunction* shared_prior(std::size_t count) {
  // Slopes of the loss per thickness: inside the contact 31 grey levels of 161 a mm on 2 mm, on the
  // bulge about three times as steep (real images of one sensor).
  constexpr std::array<double, 10> kMean = {0.693, -1.2, 0.405, 1.1, 0.2, 0.0, -0.8, -0.9, -0.9, 0};
  constexpr std::array<double, 10> kDeviation = {0.35, 0.5, 0.5, 1, 1.2, 1.2, 0.8, 0.8, 0.8, 0.3};
  constexpr std::array<double, 4> kNeighbours = {0.8, 1.2, 0.5, 0.5};
  const auto n = static_cast<Eigen::Index>(count);
  ceres::Matrix rows = ceres::Matrix::Zero(n + 4, n);
  ceres::Vector mean(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    mean[i] = kMean[static_cast<std::size_t>(i)];
    rows(i, i) = 1 / kDeviation[static_cast<std::size_t>(i)];
  }
  for (Eigen::Index i = 0; i < 4; ++i) {
    rows(n + i, kSlopes + i) = -1 / kNeighbours[static_cast<std::size_t>(i)];
    rows(n + i, kSlopes + i + 1) = 1 / kNeighbours[static_cast<std::size_t>(i)];
  }
  return new ceres::NormalPrior(rows, mean);  // the problem owns it
}

/// Parameters of one attempt.
struct State {
  std::vector<double> shared;
  std::vector<std::array<double, kOwnCount>> own;
  double cost = std::numeric_limits<double>::infinity();
};

std::unique_ptr<ceres::Problem> make_problem(std::span<const PressProfile> presses, double doubt,
                                             State& state) {
  auto problem = std::make_unique<ceres::Problem>();
  ceres::NumericDiffOptions options;
  options.relative_step_size = 1e-4;
  for (std::size_t p = 0; p < presses.size(); ++p) {
    auto cost = std::make_unique<ceres::DynamicNumericDiffCostFunction<RingCost, ceres::CENTRAL>>(
        new RingCost(presses[p], doubt, state.shared.size()), ceres::TAKE_OWNERSHIP, options);
    cost->AddParameterBlock(static_cast<int>(state.shared.size()));
    cost->AddParameterBlock(kOwnCount);
    cost->SetNumResiduals(static_cast<int>(presses[p].loss.size()));
    problem->AddResidualBlock(cost.release(), nullptr, state.shared.data(), state.own[p].data());
  }
  problem->AddResidualBlock(shared_prior(state.shared.size()), nullptr, state.shared.data());
  return problem;
}

void solve(std::span<const PressProfile> presses, double doubt, State& state) {
  const std::unique_ptr<ceres::Problem> problem = make_problem(presses, doubt, state);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = kMaxIterations;
  options.function_tolerance = 1e-5;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem.get(), &summary);
  state.cost =
      summary.IsSolutionUsable() ? summary.final_cost : std::numeric_limits<double>::infinity();
}

State start(std::span<const PressProfile> presses, double thickness_mm) {
  State state;
  state.shared = {std::log(thickness_mm), -1.2, 0.405, 1.1, 0.2, 0.0, -0.8, -0.9, -0.9, 0};
  for (const PressProfile& press : presses) {
    state.own.push_back({std::log(0.9 * press.contact_radius_mm), 0});
  }
  return state;
}

double mean_square(std::span<const double> residuals) {
  double sum = 0;
  for (const double r : residuals) sum += r * r;
  return sum / static_cast<double>(residuals.size());
}

/// Repeats the fit from a first solution, with each ring weighted by its error.
ModelFit refine(std::span<const PressProfile> presses, State best) {
  if (best.cost == std::numeric_limits<double>::infinity()) {
    throw ModelRefused(
        "no gel can be fitted to the press: check the ball's radius, the scale, and that "
        "reference and frame are not exchanged");
  }
  const auto residuals_of = [&](std::size_t p, double doubt) {
    const RingCost cost(presses[p], doubt, best.shared.size());
    std::vector<double> residuals(presses[p].loss.size());
    const std::array<const double*, 2> parameters = {best.shared.data(), best.own[p].data()};
    (void)cost(parameters.data(), residuals.data());
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      residuals[i] *= std::hypot(doubt, presses[p].noise[i]);
    }
    return residuals;
  };
  double doubt = kFirstUncertainty;
  for (int pass = 0; pass < 2; ++pass) {
    double square = 0;
    for (std::size_t p = 0; p < presses.size(); ++p) square += mean_square(residuals_of(p, doubt));
    doubt = std::max(kMinUncertainty, std::sqrt(square / static_cast<double>(presses.size())));
    solve(presses, doubt, best);
  }

  ModelFit fit;
  fit.parameters = Eigen::Map<Eigen::VectorXd>(best.shared.data(),
                                               static_cast<Eigen::Index>(best.shared.size()));
  fit.gel = gel_from(best.shared);
  double square = 0;
  for (std::size_t p = 0; p < presses.size(); ++p) {
    const double radius = std::exp(best.own[p][kRadius]);
    const double residual = mean_square(residuals_of(p, doubt));
    square += residual;
    fit.presses.push_back(
        {radius, press_ball(presses[p].ball_radius_mm, radius, fit.gel.thickness_mm).depth_mm,
         best.own[p][kOffset], std::sqrt(residual)});
  }
  fit.residual = std::sqrt(square / static_cast<double>(presses.size()));

  const std::unique_ptr<ceres::Problem> problem = make_problem(presses, doubt, best);
  ceres::CRSMatrix sparse;
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = {best.shared.data()};
  for (auto& own : best.own) options.parameter_blocks.push_back(own.data());
  problem->Evaluate(options, nullptr, nullptr, nullptr, &sparse);
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
  for (std::size_t row = 0; row < static_cast<std::size_t>(sparse.num_rows); ++row) {
    for (int i = sparse.rows[row]; i < sparse.rows[row + 1]; ++i) {
      const auto at = static_cast<std::size_t>(i);
      jacobian(static_cast<Eigen::Index>(row), sparse.cols[at]) = sparse.values[at];
    }
  }
  const Eigen::MatrixXd covariance =
      (jacobian.transpose() * jacobian)
          .ldlt()
          .solve(Eigen::MatrixXd::Identity(jacobian.cols(), jacobian.cols()));
  fit.covariance = covariance.topLeftCorner(fit.parameters.size(), fit.parameters.size());
  return fit;
}

}  // namespace

double ModelFit::deepest_mm() const {
  double deepest = 0;
  for (const Press& press : presses) deepest = std::max(deepest, press.depth_mm);
  return deepest;
}

bool ModelFit::explains() const noexcept { return residual <= 2 * kMinUncertainty; }

GelModel gel_of(const Eigen::VectorXd& parameters) {
  return gel_from(std::span(parameters.data(), static_cast<std::size_t>(parameters.size())));
}

PressProfile profile_of(const SymmetricPress& press, double light_levels, double smoothing_mm,
                        const PixelFilter& use) {
  const Contact& contact = press.contact;
  const double reach = std::min(kFarField * contact.ball_radius_mm, RadialTransform::kReachMm);
  const double step = 2 * press.map.mm_per_px;
  struct Ring {
    double loss = 0;
    double square = 0;  ///< Squared distance.
    double count = 0;
  };
  std::vector<Ring> rings(static_cast<std::size_t>(std::ceil(reach / step)));
  for (int y = 0; y < press.map.height; ++y) {
    for (int x = 0; x < press.map.width; ++x) {
      const double r = distance_mm(press.map, contact, x, y);
      const auto at = static_cast<std::size_t>(r / step);
      const double level = press.map.at(x, y);
      if (at >= rings.size() || std::isnan(level) || (use && !use(x, y))) continue;
      rings[at].loss += level / light_levels;
      rings[at].square += r * r;
      rings[at].count += 1;
    }
  }
  PressProfile profile;
  profile.ball_radius_mm = contact.ball_radius_mm;
  profile.contact_radius_mm = contact.radius_mm;
  profile.smoothing_mm = smoothing_mm;
  for (std::size_t i = 0; i < rings.size(); ++i) {
    const double all = 4 * std::numbers::pi * (2 * static_cast<double>(i) + 1);
    const Ring& ring = rings[i];
    if (ring.count < 0.3 * all) continue;  // a sliver at the map's border
    profile.radius_mm.push_back(std::sqrt(ring.square / ring.count));
    profile.loss.push_back(ring.loss / ring.count);
    profile.noise.push_back(kFrameNoise / light_levels / std::sqrt(ring.count));
  }
  return profile;
}

ModelFit fit_model(std::span<const PressProfile> presses) {
  if (presses.empty()) throw std::invalid_argument("no press to fit a model to");
  State best;
  for (const double thickness_mm : kStartThicknesses) {
    State state = start(presses, thickness_mm);
    solve(presses, kFirstUncertainty, state);
    if (state.cost < best.cost) best = std::move(state);
  }
  return refine(presses, std::move(best));
}

ModelFit fit_model(std::span<const PressProfile> presses, const ModelFit& from) {
  State state = start(presses, from.gel.thickness_mm);
  state.shared.assign(from.parameters.begin(), from.parameters.end());
  solve(presses, kFirstUncertainty, state);
  return refine(presses, std::move(state));
}

}  // namespace dtact::calibration
