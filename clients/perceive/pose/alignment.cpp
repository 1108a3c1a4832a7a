#include "clients/perceive/pose/alignment.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace dtact::perceive {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kMaxSteps = 20;
/// A step shorter than this is the last, metres.
constexpr double kConverged = 2e-7;
/// Eigenvalues of the normal equations are mean squares of the distances' change per unit of
/// motion. Below kMinCore in the contact, a direction cannot be separated from the error of the
/// normals: 3°, whose square is 0.003, and kNoises times their variance. That scatters by √(2/n) of
/// itself for n independent normals. Twice as much would leave out the rotation of two balls about
/// the line between them, which blur makes less round, and loses sensor_b's lopsided ball.
constexpr double kMinCore = 0.003;
constexpr double kNoises = 3;
/// Times the number of independent places an eigenvalue below this is of an unobservable direction:
/// the motion along it would have a standard deviation of 0.1 mm where each place errs by 0.02 mm.
/// Through the daemon a ball's turns have at most 0.00007 at 250 places, a disc's 0.00004 at 680,
/// and those of an M4 nut, whose outline has six corners, 0.00012 to 0.00036 at 500.
constexpr double kMinInformation = 0.04;
/// Noise is alike over the smoothing's 7 × 7 pixels of 0.0414 mm: one independent place in each of
/// these areas, square metres.
constexpr double kCorrelatedArea = 8.39e-8;
/// Variance along a direction that is not determined, and the one from which it is reported, m²:
/// much larger would report a ball's sliding, too, where two of its turns are about centres 0.05 mm
/// apart.
constexpr double kUnknownVariance = 4e-6;
constexpr double kReportedVariance = 9e-8;
/// Distance from which on a pair has no weight, metres: some four times the uncertainty of a depth
/// map, so that the shoulders count, whose distances are larger than those of a flat face.
constexpr double kMaxDistance = 3e-4;

/// Normals that differ by more than 26° are of different places of the object: squared.
constexpr double kMaxDifference = 0.2;

/// A surfel and the gel that it is compared with.
struct Pair {
  Vector3d moved;
  Vector3d edge;  ///< The surfel's edge, moved.
  double share = 1;
  Vector3d normal;        ///< Mean of the surfel's and the gel's.
  Vector3d upright;       ///< The undeformed surface's normal.
  double difference = 0;  ///< Squared, of both normals.
  double distance = 0;    ///< From the gel to where the surfel should be, along `normal`, metres.
};

/// Tukey's weight.
double weight_of(double distance) {
  const double part = distance / kMaxDistance;
  if (std::abs(part) >= 1) return 0;
  const double rest = 1 - part * part;
  return rest * rest;
}

std::vector<Pair> associate(std::span<const Surfel> surfels, const ContactView& view,
                            const Motion& motion) {
  std::vector<Pair> pairs;
  pairs.reserve(surfels.size());
  for (const Surfel& surfel : surfels) {
    Pair pair;
    pair.moved = motion * surfel.point;
    const auto gel = view.at(pair.moved);
    if (!gel) continue;
    double below = gel->below;
    pair.edge = motion * surfel.edge;
    pair.share = surfel.share;
    if (pair.share < 1) {
      const auto at_edge = view.at(pair.edge);
      if (!at_edge) continue;
      below = pair.share * std::max(0.0, at_edge->below);
    }
    if (std::max(gel->depth, below) < view.pressed()) continue;
    // The mean of both normals has half the noise of one.
    const Vector3d turned = motion.linear() * surfel.normal;
    pair.normal = (turned + gel->normal).normalized();
    pair.difference = (turned - gel->normal).squaredNorm();
    pair.upright = gel->upright;
    pair.distance = pair.normal.dot(pair.moved + (gel->below - below) * pair.upright - gel->point);
    pairs.push_back(pair);
  }
  return pairs;
}

/// Normal equations of a step: a twist about the alignment's centre.
struct Equations {
  Matrix6 matrix = Matrix6::Zero();
  Twist vector = Twist::Zero();
  double weight = 0;

  void add(const Twist& row, double distance, double w) {
    matrix += (w * row) * row.transpose();
    vector -= w * distance * row;
    weight += w;
  }
};

struct AllEquations {
  Equations core;  ///< Where the object lies on the gel.
  Equations shoulders;
  double noise = 0;  ///< Variance of a core's normal along one axis.
};

AllEquations equations_of(const std::vector<Pair>& pairs, std::size_t surfels, Alignment& at) {
  at.centre.setZero();
  for (const Pair& pair : pairs) at.centre += pair.moved;
  at.centre /= static_cast<double>(pairs.size());
  double squares = 0;
  for (const Pair& pair : pairs) squares += (pair.moved - at.centre).squaredNorm();
  at.arm = std::max(1e-5, std::sqrt(squares / static_cast<double>(pairs.size())));
  AllEquations all;
  std::vector<double> differences;
  at.points = 0;
  squares = 0;
  for (const Pair& pair : pairs) {
    const double weight = pair.difference > kMaxDifference ? 0 : weight_of(pair.distance);
    if (weight == 0) continue;
    Twist row;
    // A shoulder moves along the surface as the object does, and down by its share of the edge.
    const double rise = pair.normal.dot(pair.upright);
    const Vector3d along = pair.normal - rise * pair.upright;
    const Vector3d across = pair.share * rise * pair.upright;
    row << ((pair.moved - at.centre).cross(along) + (pair.edge - at.centre).cross(across)) / at.arm,
        along + across;
    (pair.share == 1 ? all.core : all.shoulders).add(row, pair.distance, weight);
    if (pair.share == 1) differences.push_back(pair.difference);
    squares += weight * pair.distance * pair.distance;
    ++at.points;
  }
  at.overlap = static_cast<double>(at.points) / static_cast<double>(surfels);
  at.fit = static_cast<double>(at.points) / static_cast<double>(pairs.size());
  const double weight = all.core.weight + all.shoulders.weight;
  if (weight > 0) at.rms = std::sqrt(squares / weight);
  if (!differences.empty()) {
    const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
    std::ranges::nth_element(differences, middle);
    // The difference errs along two axes: a sum of two squares, whose median is 2 ln 2 variances,
    // and it has four times the variance of the mean.
    all.noise = *middle / (8 * std::numbers::ln2);
  }
  return all;
}

/// Orthonormal twists, one a column.
using Twists = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>;

/// The subspace of the orthonormal `twists` that rotates the object about axes along the surface.
Twists rolls_of(const Twists& twists, const Vector3d& upright) {
  if (twists.cols() == 0) return twists;
  const Eigen::MatrixXd turns =
      (Matrix3d::Identity() - upright * upright.transpose()) * twists.topRows<3>();
  const Eigen::JacobiSVD<Eigen::MatrixXd> parts(turns, Eigen::ComputeFullV);
  constexpr double kMinTurn = 0.1;
  const auto rolling = (parts.singularValues().array() > kMinTurn).count();
  return twists * parts.matrixV().leftCols(rolling);
}

/// The mean of core and shoulder equations, without the parts that each must not determine. In
/// directions that the shape in contact does not determine, the core's normals are noise and only
/// shoulders count: they follow the object's edges. They also follow the rim of a round contact,
/// which stays in place while the object rolls. So shoulders alone do not determine a roll.
Equations mean_of(const AllEquations& all, double min_core, const Vector3d& upright) {
  Equations mean;
  mean.weight = all.core.weight + all.shoulders.weight;
  if (!(mean.weight > 0)) return mean;
  Matrix6 shown = Matrix6::Identity();
  Matrix6 allowed = Matrix6::Identity();
  if (all.core.weight > 0) {
    const Eigen::SelfAdjointEigenSolver<Matrix6> spectrum(all.core.matrix / all.core.weight);
    const auto unobservable = (spectrum.eigenvalues().array() < min_core).count();
    const Twists unseen = spectrum.eigenvectors().leftCols(unobservable);
    const Twists rolls = rolls_of(unseen, upright);
    shown -= unseen * unseen.transpose();
    allowed -= rolls * rolls.transpose();
  }
  mean.matrix =
      (shown * all.core.matrix * shown + allowed * all.shoulders.matrix * allowed) / mean.weight;
  mean.vector = (shown * all.core.vector + allowed * all.shoulders.vector) / mean.weight;
  return mean;
}

/// The step with the least rotation among those that differ only in unobservable directions.
Twist min_turn(const Twist& step, const std::vector<Twist>& free) {
  if (free.empty()) return step;
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 6> turns(3, free.size());
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6> twists(6, free.size());
  for (std::size_t i = 0; i < free.size(); ++i) {
    twists.col(static_cast<Eigen::Index>(i)) = free[i];
  }
  turns = twists.topRows<3>();
  // The pseudoinverse of `turns`, by its left singular vectors. What turns less is a slide, but for
  // noise.
  constexpr double kMinTurn = 0.05;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> parts(turns * turns.transpose());
  Vector3d undone = Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const double squared = parts.eigenvalues()[axis];
    if (squared <= kMinTurn * kMinTurn) continue;
    const Vector3d direction = parts.eigenvectors().col(axis);
    undone += direction * (direction.dot(step.head<3>()) / squared);
  }
  return step - twists * (turns.transpose() * undone);
}

Matrix3d cross(const Vector3d& v) {
  Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

/// A twist about `centre` as one about the origin in radians and metres.
Matrix6 to_origin(const Vector3d& centre, double arm) {
  Matrix6 map = Matrix6::Identity();
  map.topLeftCorner<3, 3>() /= arm;
  map.bottomLeftCorner<3, 3>() = cross(centre) / arm;
  return map;
}

void apply(const Twist& step, Alignment& to) {
  const Matrix3d rotation = rotation_by(step.head<3>() / to.arm);
  Motion move = Motion::Identity();
  move.linear() = rotation;
  move.translation() = to.centre + step.tail<3>() - rotation * to.centre;
  to.motion = move * to.motion;
}

}  // namespace

Alignment align(std::span<const Surfel> surfels, const ContactView& view, const Motion& start) {
  Alignment result;
  result.motion = start;
  for (int i = 0; i < kMaxSteps; ++i) {
    const std::vector<Pair> pairs = associate(surfels, view, result.motion);
    constexpr std::size_t kMinPairs = 12;
    if (pairs.size() < kMinPairs) {
      result.points = 0;
      result.overlap = 0;
      return result;
    }
    const AllEquations all = equations_of(pairs, surfels.size(), result);
    const double places = std::max(1.0, view.area() * result.overlap / kCorrelatedArea);
    const double noise = kNoises * (1 + std::sqrt(2 / places)) * all.noise;
    const Equations mean = mean_of(all, kMinCore + noise, view.upright());
    if (!(mean.weight > 0)) return result;
    const Eigen::SelfAdjointEigenSolver<Matrix6> spectrum(mean.matrix);
    Twist step = Twist::Zero();
    Matrix6 covariance = Matrix6::Zero();
    std::vector<Twist> free;
    for (int k = 0; k < 6; ++k) {
      const Twist direction = spectrum.eigenvectors().col(k);
      const double seen = spectrum.eigenvalues()[k];
      double variance = kUnknownVariance;
      if (seen * places < kMinInformation) {
        free.push_back(direction);
      } else {
        step += direction * (direction.dot(mean.vector) / seen);
        variance = result.rms * result.rms / (seen * places);
      }
      covariance += variance * direction * direction.transpose();
    }
    const Matrix6 map = to_origin(result.centre, result.arm);
    result.covariance = map * covariance * map.transpose();
    step = min_turn(step, free);
    apply(step, result);
    if (step.norm() < kConverged) break;
  }
  return result;
}

Matrix6 unknown_along(std::span<const Twist> twists, const Vector3d& centre, double arm) {
  Matrix6 covariance = Matrix6::Zero();
  for (const Twist& twist : twists) covariance += kUnknownVariance * twist * twist.transpose();
  const Matrix6 map = to_origin(centre, arm);
  return map * covariance * map.transpose();
}

std::vector<Twist> unobservable_of(const Matrix6& covariance, const Vector3d& centre, double arm) {
  if (!(arm > 0)) return {};
  const Matrix6 map = to_origin(centre, arm).inverse();
  const Eigen::SelfAdjointEigenSolver<Matrix6> spectrum(map * covariance * map.transpose());
  std::vector<Twist> found;
  for (int k = 0; k < 6; ++k) {
    if (spectrum.eigenvalues()[k] > kReportedVariance) {
      found.emplace_back(spectrum.eigenvectors().col(k));
    }
  }
  return found;
}

Matrix6 carried(const Matrix6& covariance, const Motion& after) {
  Matrix6 adjoint = Matrix6::Zero();
  adjoint.topLeftCorner<3, 3>() = after.linear();
  adjoint.bottomRightCorner<3, 3>() = after.linear();
  adjoint.bottomLeftCorner<3, 3>() = cross(after.translation()) * after.linear();
  return adjoint * covariance * adjoint.transpose();
}

}  // namespace dtact::perceive
