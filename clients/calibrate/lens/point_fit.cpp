#include "clients/calibrate/lens/point_fit.hpp"

#include <ceres/dynamic_numeric_diff_cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

namespace dtact::ctl {
namespace {

using recon::Lens;
using recon::Point;

constexpr LensModel kModels[] = {LensModel::affine,  LensModel::projective, LensModel::radial1,
                                 LensModel::radial2, LensModel::radial3,    LensModel::radial4};
constexpr std::size_t kHomography = 8;

std::size_t radial_terms(LensModel model) {
  return static_cast<std::size_t>(std::max(0, static_cast<int>(model) - 1));
}

/// Units in which all parameters are of the order of one: the marks' own extents.
struct Units {
  Point px;        ///< Their middle, pixels.
  Point mm;        ///< Their middle, millimetres.
  double px_size;  ///< Greatest distance from the middle.
  double mm_size;
};

Units units_of(std::span<const Mark> marks) {
  Units units{};
  for (const Mark& mark : marks) {
    units.px = {units.px.x + mark.px.x, units.px.y + mark.px.y};
    units.mm = {units.mm.x + mark.mm.x, units.mm.y + mark.mm.y};
  }
  const auto n = static_cast<double>(marks.size());
  units.px = {units.px.x / n, units.px.y / n};
  units.mm = {units.mm.x / n, units.mm.y / n};
  for (const Mark& mark : marks) {
    units.px_size =
        std::max(units.px_size, std::hypot(mark.px.x - units.px.x, mark.px.y - units.px.y));
    units.mm_size =
        std::max(units.mm_size, std::hypot(mark.mm.x - units.mm.x, mark.mm.y - units.mm.y));
  }
  return units;
}

/// Parameters in `units`: eight of the homography, two of the centre, the radial ones.
using Parameters = std::vector<double>;

Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> homography_of(Lens& lens) {
  return Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(lens.homography.data());
}

Lens lens_of(const Parameters& p, const Units& u) {
  const Eigen::Matrix3d inner{{p[0], p[1], p[2]}, {p[3], p[4], p[5]}, {p[6], p[7], 1}};
  const Eigen::Matrix3d to_px{{u.px_size, 0, u.px.x}, {0, u.px_size, u.px.y}, {0, 0, 1}};
  const Eigen::Matrix3d from_mm{
      {1 / u.mm_size, 0, -u.mm.x / u.mm_size}, {0, 1 / u.mm_size, -u.mm.y / u.mm_size}, {0, 0, 1}};
  const Eigen::Matrix3d h = to_px * inner * from_mm;
  Lens lens;
  homography_of(lens) = h / h(2, 2);
  lens.centre_col = u.px.x + p[8] * u.px_size;
  lens.centre_row = u.px.y + p[9] * u.px_size;
  lens.radius_px = u.px_size;
  lens.radial.assign(p.begin() + kHomography + 2, p.end());
  return lens;
}

/// Distances of all marks in the picture, in `units`. Free parameters come first;
/// the others keep their values.
class MarkCost {
 public:
  MarkCost(std::span<const Mark> marks, const Units& units, const Parameters& start,
           std::size_t free)
      : marks_(marks), units_(units), start_(start), free_(free) {}

  bool operator()(const double* const* free, double* errors) const {
    Parameters p = start_;
    std::copy_n(free[0], free_, p.begin());
    const Lens lens = lens_of(p, units_);
    for (const Mark& mark : marks_) {
      const Point at = project(lens, mark.mm);
      // Where the lens folds it shows no mark: the penalty is the marks' extent, far more than
      // any step gains elsewhere.
      const bool shown = std::isfinite(at.x) && std::isfinite(at.y);
      *errors++ = shown ? (at.x - mark.px.x) / units_.px_size : 1;
      *errors++ = shown ? (at.y - mark.px.y) / units_.px_size : 1;
    }
    return true;
  }

 private:
  std::span<const Mark> marks_;
  Units units_;
  Parameters start_;
  std::size_t free_;
};

Parameters affine_start(std::span<const Mark> marks, const Units& u, std::size_t terms) {
  const auto count = static_cast<Eigen::Index>(marks.size());
  Eigen::MatrixXd a(count, 3);
  Eigen::MatrixXd b(count, 2);
  Eigen::Index i = 0;
  for (const Mark& mark : marks) {
    a(i, 0) = (mark.mm.x - u.mm.x) / u.mm_size;
    a(i, 1) = (mark.mm.y - u.mm.y) / u.mm_size;
    a(i, 2) = 1;
    b(i, 0) = (mark.px.x - u.px.x) / u.px_size;
    b(i, 1) = (mark.px.y - u.px.y) / u.px_size;
    ++i;
  }
  // Marks on a line leave one direction of the plane open. They are in units of their own
  // extent, so that noise alone stays far below a thousandth.
  constexpr double kLine = 1e-3;
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  if (svd.singularValues()[2] < kLine * svd.singularValues()[0]) {
    throw FitFailed("lens: the points lie on a line; use a board with several rows");
  }
  const Eigen::MatrixXd x = svd.solve(b);
  Parameters p(kHomography + 2 + terms, 0.0);
  for (int c = 0; c < 3; ++c) {
    p[static_cast<std::size_t>(c)] = x(c, 0);
    p[static_cast<std::size_t>(c) + 3] = x(c, 1);
  }
  return p;
}

/// Fits the model's parameters, the first ones of `p`. Throws FitFailed when the solver fails, so
/// that a smaller model's parameters are not returned as this one's.
void minimise(Parameters& p, const Units& u, std::span<const Mark> marks, LensModel model) {
  const int n = parameters(model);
  auto cost = std::make_unique<ceres::DynamicNumericDiffCostFunction<MarkCost, ceres::CENTRAL>>(
      new MarkCost(marks, u, p, static_cast<std::size_t>(n)));
  cost->AddParameterBlock(n);
  cost->SetNumResiduals(static_cast<int>(2 * marks.size()));
  ceres::Problem problem;
  problem.AddResidualBlock(cost.release(), nullptr, p.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 60;
  options.function_tolerance = 1e-12;  // relative change of the sum of squares
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) {
    throw FitFailed("lens: no lens of " + std::to_string(n) +
                    " parameters fits the points; look for points that were found wrong");
  }
}

/// The best parameters for all marks, in `u`.
Parameters fit(std::span<const Mark> marks, const Units& u, LensModel model) {
  if (marks.size() < static_cast<std::size_t>(parameters(model))) {
    throw FitFailed("lens: too few points");
  }
  Parameters p = affine_start(marks, u, radial_terms(model));
  // The larger model starts at the smaller one's result: a lens's terms are correlated.
  for (const LensModel stage : kModels) {
    if (stage > model) break;
    if (stage != LensModel::affine) minimise(p, u, marks, stage);
  }
  return p;
}

double square(Point p) { return p.x * p.x + p.y * p.y; }

}  // namespace

int parameters(LensModel model) {
  constexpr int kParameters[] = {6, 8, 11, 12, 13, 14};
  return kParameters[static_cast<int>(model)];
}

Lens fit_lens(std::span<const Mark> marks, LensModel model) {
  const Units u = units_of(marks);
  return lens_of(fit(marks, u, model), u);
}

std::vector<Point> residuals_mm(const Lens& lens, std::span<const Mark> marks) {
  constexpr double kStep = 1e-3;  // mm
  std::vector<Point> residuals;
  for (const Mark& mark : marks) {
    const Point at = project(lens, mark.mm);
    const Point right = project(lens, {mark.mm.x + kStep, mark.mm.y});
    const Point below = project(lens, {mark.mm.x, mark.mm.y + kStep});
    const Eigen::Matrix2d jacobian{{(right.x - at.x) / kStep, (below.x - at.x) / kStep},
                                   {(right.y - at.y) / kStep, (below.y - at.y) / kStep}};
    const Eigen::Vector2d mm =
        jacobian.inverse() * Eigen::Vector2d(mark.px.x - at.x, mark.px.y - at.y);
    residuals.push_back({mm[0], mm[1]});
  }
  return residuals;
}

double rms(std::span<const Point> residuals) {
  double sum = 0;
  for (const Point& r : residuals) sum += square(r);
  return std::sqrt(sum / static_cast<double>(residuals.size()));
}

std::vector<Point> leave_one_out(std::span<const Mark> marks, LensModel model) {
  const Units u = units_of(marks);
  const Parameters all = fit(marks, u, model);
  std::vector<Point> residuals;
  for (std::size_t out = 0; out < marks.size(); ++out) {
    std::vector<Mark> others(marks.begin(), marks.end());
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(out));
    Parameters p = all;  // One mark moves the minimum a little: a few steps from here.
    minimise(p, u, others, model);
    residuals.push_back(residuals_mm(lens_of(p, u), marks.subspan(out, 1)).front());
  }
  return residuals;
}

bool clearly_lower(std::span<const double> squares, std::span<const double> others) {
  constexpr double kErrors = 2;  // standard errors: about one chance in forty
  double sum = 0;
  double sum2 = 0;
  for (std::size_t i = 0; i < squares.size(); ++i) {
    const double gain = others[i] - squares[i];
    sum += gain;
    sum2 += gain * gain;
  }
  const auto n = static_cast<double>(squares.size());
  const double mean = sum / n;
  return mean > kErrors * std::sqrt(std::max(0.0, sum2 / n - mean * mean) / (n - 1));
}

ChosenLens choose_lens(std::span<const Mark> marks) {
  ChosenLens best;
  std::vector<double> best_squares;
  for (const LensModel model : kModels) {
    // Needs at least twice as many coordinates as parameters, also with one mark left out.
    if (marks.size() < static_cast<std::size_t>(parameters(model)) + 1) break;
    std::vector<Point> left_out;
    try {
      left_out = leave_one_out(marks, model);
    } catch (const FitFailed&) {
      if (best.left_out.empty()) throw;
      break;  // the larger ones start where this one ends
    }
    const double error = rms(left_out);
    best.left_out_rms_of_each.push_back(error);
    std::vector<double> squares;
    squares.reserve(left_out.size());
    for (const Point& r : left_out) squares.push_back(square(r));
    if (best.left_out.empty() || clearly_lower(squares, best_squares)) {
      best_squares = std::move(squares);
      best.model = model;
      best.left_out = std::move(left_out);
    }
  }
  if (best.left_out.empty()) throw std::runtime_error("lens: too few points");
  best.lens = fit_lens(marks, best.model);
  best.in_sample = residuals_mm(best.lens, marks);
  return best;
}

void level(Lens& lens, std::span<Mark> marks) {
  constexpr double kStep = 1e-4;  // mm
  const Point at = project(lens, {0, 0});
  const Point right = project(lens, {kStep, 0});
  const Point below = project(lens, {0, kStep});
  // J = R·S with S symmetric: the rotation's angle is that of (J + cofactor(J)).
  const double angle =
      std::atan2((right.y - at.y) - (below.x - at.x), (right.x - at.x) + (below.y - at.y));
  const Eigen::Matrix3d turn{
      {std::cos(angle), std::sin(angle), 0}, {-std::sin(angle), std::cos(angle), 0}, {0, 0, 1}};
  homography_of(lens) *= turn;
  for (Mark& mark : marks) {
    const Eigen::Vector3d mm = turn.transpose() * Eigen::Vector3d(mark.mm.x, mark.mm.y, 1);
    mark.mm = {mm[0], mm[1]};
  }
}

}  // namespace dtact::ctl
