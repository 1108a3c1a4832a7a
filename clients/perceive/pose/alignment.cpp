#include "clients/perceive/pose/alignment.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace dtact::perceive {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kMostSteps = 15;
/// A step shorter than this is the last, metres.
constexpr double kConverged = 2e-7;
/// Differences of normals count as distances at this arm, metres: what a normal's noise of some
/// degrees and a depth's of some micrometres make equally certain.
constexpr double kNormalArm = 1e-4;
/// Eigenvalues are mean squares of what the residuals change for a unit of motion. Below this a
/// direction is not told from what normals err by, 3° at least, whose square is 0.003.
constexpr double kSeen = 0.003;
/// And below so many times the square of what the normals compared differ by, each one's share.
constexpr double kSeenInNoise = 3;
/// Where noise is alike, since depth is smoothed over 7×7 pixels of 0.0414 mm, square metres: of so
/// much one place tells something that the others do not.
constexpr double kAlike = 8.39e-8;
/// Tukey's limit in median absolute residuals: 4.685 standard deviations of 1.48 medians.
constexpr double kTukey = 4.685 * 1.4826;
/// The least and the first limit of distances, metres.
constexpr double kLeastLimit = 1e-5;
constexpr double kFirstLimit = 3e-4;

struct Pair {
  Eigen::Vector3d moved;
  Eigen::Vector3d turned;  ///< The surfel's normal.
  ContactView::Sample sample;
  double distance = 0;
};

double tukey(double residual, double limit) {
  const double part = residual / limit;
  if (std::abs(part) >= 1) return 0;
  const double rest = 1 - part * part;
  return rest * rest;
}

std::vector<Pair> associate(std::span<const Surfel> surfels, const ContactView& view,
                            const Motion& motion) {
  std::vector<Pair> pairs;
  pairs.reserve(surfels.size());
  for (const Surfel& surfel : surfels) {
    const Eigen::Vector3d moved = motion * surfel.point;
    const auto sample = view.at(moved);
    if (!sample) continue;
    const double distance = sample->normal.dot(moved - sample->point);
    pairs.push_back({moved, motion.rotation * surfel.normal, *sample, distance});
  }
  return pairs;
}

double limit_of(const std::vector<Pair>& pairs) {
  std::vector<double> sizes;
  sizes.reserve(pairs.size());
  for (const Pair& pair : pairs) sizes.push_back(std::abs(pair.distance));
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return std::clamp(kTukey * *middle, kLeastLimit, kFirstLimit);
}

/// The normal equations of a step, of a twist about `centre` with the rotation times `arm`.
struct Equations {
  Matrix6 matrix = Matrix6::Zero();
  Twist vector = Twist::Zero();
  double weight = 0;
  double squares = 0;
  double normal_squares = 0;  ///< Of the normals' differences along both axes.
  std::size_t points = 0;

  void add(const Twist& row, double residual, double w) {
    matrix += (w * row) * row.transpose();
    vector -= w * residual * row;
  }
};

Equations equations_of(const std::vector<Pair>& pairs, const Eigen::Vector3d& centre, double arm,
                       double limit) {
  Equations sum;
  for (const Pair& pair : pairs) {
    const double weight = tukey(pair.distance, limit);
    if (weight == 0) continue;
    const Eigen::Vector3d from = pair.moved - centre;
    const Eigen::Vector3d& normal = pair.sample.normal;
    Twist row;
    row << from.cross(normal) / arm, normal;
    sum.add(row, pair.distance, weight);
    // The place moves over the view, whose normal bends; the surfel's own turns. Without the one
    // the other would say of a ball that its turning is seen, the more the smaller the contact.
    for (int axis = 0; pair.sample.bend && axis < 2; ++axis) {
      const Eigen::Vector3d bend = pair.sample.bend->change.row(axis);
      const Eigen::Vector3d unit = pair.sample.bend->axes.col(axis);
      const double difference = unit.dot(normal - pair.turned);
      row << (from.cross(bend) - pair.turned.cross(unit)) / arm, bend;
      sum.add(kNormalArm * row, kNormalArm * difference, weight);
      sum.normal_squares += weight * difference * difference;
    }
    sum.weight += weight;
    sum.squares += weight * pair.distance * pair.distance;
    ++sum.points;
  }
  return sum;
}

/// Eigenvalues below this are of directions that are not seen. What noise alone makes of one is a
/// mean of squares, which scatters by √(2/n) of itself where n of them are independent: a ball that
/// has just touched would otherwise be turned by noise once in 50 presses.
double least_seen(const Equations& sum, const ContactView& view) {
  const double places = view.area() / kAlike;
  const double independent = std::clamp(places, 1.0, static_cast<double>(sum.points));
  // Two components of two normals.
  const double noise = sum.normal_squares / sum.weight / 4;
  return std::max(kSeen, kSeenInNoise * (1 + std::sqrt(2 / independent)) * noise);
}

/// Of the steps that do the same to what is seen, the one that turns least.
Twist least_turn(const Twist& step, const std::vector<Twist>& unobservable) {
  if (unobservable.empty()) return step;
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6> free(6, unobservable.size());
  for (std::size_t i = 0; i < unobservable.size(); ++i) {
    free.col(static_cast<Eigen::Index>(i)) = unobservable[i];
  }
  const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 6> turns = free.topRows<3>();
  // The pseudoinverse of `turns` by its left singular vectors.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts(turns * turns.transpose());
  Eigen::Vector3d undone = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    // What turns less than this is a slide, but for noise.
    constexpr double kTurns = 0.05;
    const double squared = parts.eigenvalues()[axis];
    if (squared <= kTurns * kTurns) continue;
    const Eigen::Vector3d direction = parts.eigenvectors().col(axis);
    undone += direction * (direction.dot(step.head<3>()) / squared);
  }
  return step - free * (turns.transpose() * undone);
}

void apply(const Twist& step, const Eigen::Vector3d& centre, double arm, Motion& motion) {
  const Eigen::Vector3d turn = step.head<3>() / arm;
  const double angle = turn.norm();
  const Eigen::Matrix3d rotation = angle > 0
                                       ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix()
                                       : Eigen::Matrix3d::Identity();
  motion.rotation = rotation * motion.rotation;
  motion.translation = rotation * (motion.translation - centre) + centre + step.tail<3>();
}

}  // namespace

Twist screw_of(const Motion& motion, const Eigen::Vector3d& centre, double arm) {
  const Eigen::AngleAxisd turn(motion.rotation);
  const double angle = turn.angle();
  const Eigen::Vector3d& axis = turn.axis();
  const Eigen::Vector3d shift = motion * centre - centre;
  Eigen::Vector3d along = shift;
  // The inverse of the left Jacobian of SO(3): Barfoot, State Estimation for Robotics, 7.1.3.
  constexpr double kLeast = 1e-6;
  if (angle > kLeast) {
    const double half = angle / 2;
    const double cotangent = half / std::tan(half);
    along = cotangent * shift + (1 - cotangent) * axis * axis.dot(shift) - half * axis.cross(shift);
  }
  Twist twist;
  twist << arm * angle * axis, along;
  return twist;
}

Alignment align(std::span<const Surfel> surfels, const ContactView& view, const Motion& start) {
  Alignment result;
  result.motion = start;
  double limit = kFirstLimit;
  for (int i = 0; i < kMostSteps; ++i) {
    const std::vector<Pair> pairs = associate(surfels, view, result.motion);
    constexpr std::size_t kFewest = 12;
    if (pairs.size() < kFewest) {
      result.points = 0;
      result.overlap = 0;
      return result;
    }
    if (i > 0) limit = limit_of(pairs);
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const Pair& pair : pairs) centre += pair.moved;
    centre /= static_cast<double>(pairs.size());
    double squares = 0;
    for (const Pair& pair : pairs) squares += (pair.moved - centre).squaredNorm();
    const double arm = std::max(1e-5, std::sqrt(squares / static_cast<double>(pairs.size())));
    const Equations sum = equations_of(pairs, centre, arm, limit);
    result.centre = centre;
    result.arm = arm;
    result.points = sum.points;
    result.overlap = static_cast<double>(sum.points) / static_cast<double>(surfels.size());
    if (!(sum.weight > 0)) return result;
    result.rms = std::sqrt(sum.squares / sum.weight);
    const Eigen::SelfAdjointEigenSolver<Matrix6> spectrum(sum.matrix / sum.weight);
    const Twist right = sum.vector / sum.weight;
    const double seen = least_seen(sum, view);
    Twist step = Twist::Zero();
    result.unobservable.clear();
    for (int k = 0; k < 6; ++k) {
      const Twist direction = spectrum.eigenvectors().col(k);
      if (spectrum.eigenvalues()[k] < seen) {
        result.unobservable.push_back(direction);
      } else {
        step += direction * (direction.dot(right) / spectrum.eigenvalues()[k]);
      }
    }
    step = least_turn(step, result.unobservable);
    apply(step, centre, arm, result.motion);
    if (step.norm() < kConverged) break;
  }
  return result;
}

}  // namespace dtact::perceive
