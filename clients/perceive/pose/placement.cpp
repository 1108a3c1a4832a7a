#include "clients/perceive/pose/placement.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace dtact::perceive {
namespace {

using Eigen::Vector3d;

/// Steeper parts of the object are walls, no underside.
constexpr double kMinUpright = 0.1;
/// A place and its surfel look the same way within this cosine.
constexpr double kSameWay = 0.7;
/// What an object inside the gel costs: at most, for each place of the core.
constexpr double kInside = 1.5;
/// Inside by this is allowed to noise and to edges between samples, metres.
constexpr double kAllowed = 3e-5;
/// The `limit` of score_of() at the last steps, metres.
constexpr double kFineLimit = 1e-4;

double inside(double gap, double limit) { return std::clamp((-gap - kAllowed) / limit, 0.0, 1.0); }

}  // namespace

BottomView::BottomView(const ObjectModel& object, const Eigen::Matrix3d& turn, double highest) {
  const Vector3d up = turn.row(2);
  double lowest = INFINITY;
  for (const Surfel& surfel : object.surfels) lowest = std::min(lowest, up.dot(surfel.point));
  from_object_.linear() = turn;
  from_object_.translation() = Vector3d(0, 0, -lowest);
  Eigen::AlignedBox2d box;
  for (const Surfel& surfel : object.surfels) {
    if (up.dot(surfel.point) > lowest + highest || up.dot(surfel.normal) < kMinUpright) continue;
    surfels_.push_back({from_object_ * surfel.point, turn * surfel.normal});
    box.extend(surfels_.back().point.head<2>());
  }
  if (surfels_.empty()) return;
  const double cell = object.spacing;
  per_cell_ = 1 / cell;
  x0_ = box.min().x() - 0.5 * cell;
  y0_ = box.min().y() - 0.5 * cell;
  width_ = static_cast<int>((box.max().x() - x0_) * per_cell_) + 1;
  height_ = static_cast<int>((box.max().y() - y0_) * per_cell_) + 1;
  cells_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), -1);
  for (std::size_t i = 0; i < surfels_.size(); ++i) {
    const Vector3d& point = surfels_[i].point;
    auto& held = cells_[static_cast<std::size_t>((point.y() - y0_) * per_cell_) *
                            static_cast<std::size_t>(width_) +
                        static_cast<std::size_t>((point.x() - x0_) * per_cell_)];
    if (held < 0 || point.z() < surfels_[static_cast<std::size_t>(held)].point.z()) {
      held = static_cast<std::int32_t>(i);
    }
  }
  fill_holes();
}

/// Cells that got no surfel by chance, between others that did, have a neighbour's.
void BottomView::fill_holes() {
  constexpr int kMax = 5;
  const std::vector<std::int32_t> before = cells_;
  const auto width = static_cast<std::ptrdiff_t>(width_);
  for (std::ptrdiff_t row = 1; row + 1 < height_; ++row) {
    for (std::ptrdiff_t column = 1; column + 1 < width; ++column) {
      const std::ptrdiff_t i = row * width + column;
      if (before[static_cast<std::size_t>(i)] >= 0) continue;
      int filled = 0;
      std::int32_t one = -1;
      for (const std::ptrdiff_t beside : {-width - 1, -width, -width + 1, std::ptrdiff_t{-1},
                                          std::ptrdiff_t{1}, width - 1, width, width + 1}) {
        const std::int32_t held = before[static_cast<std::size_t>(i + beside)];
        if (held < 0) continue;
        ++filled;
        one = held;
      }
      if (filled >= kMax) cells_[static_cast<std::size_t>(i)] = one;
    }
  }
}

BottomView::Low BottomView::below(double height) const {
  Low low;
  std::size_t count = 0;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    const std::int32_t held = cells_[i];
    if (held < 0 || surfels_[static_cast<std::size_t>(held)].point.z() > height) continue;
    const std::size_t row = i / static_cast<std::size_t>(width_);
    const std::size_t column = i % static_cast<std::size_t>(width_);
    low.middle += Eigen::Vector2d(static_cast<double>(column), static_cast<double>(row));
    ++count;
  }
  if (count == 0) return low;
  low.middle /= static_cast<double>(count);
  low.middle = Eigen::Vector2d(x0_, y0_) + (low.middle + Eigen::Vector2d(0.5, 0.5)) / per_cell_;
  low.area = static_cast<double>(count) / (per_cell_ * per_cell_);
  return low;
}

double score_of(const BottomView& bottom, const ContactPatch& patch, const Motion& move,
                double limit) {
  double explained = 0;
  double wrong = 0;
  for (const auto& sample : patch.core) {
    const Vector3d point = move * sample.point;
    const Surfel* surfel = bottom.at(point);
    if (surfel == nullptr) continue;
    const double gap = surfel->normal.dot(surfel->point - point);
    const double part = gap / limit;
    if (std::abs(part) < 1 && surfel->normal.dot(move.linear() * sample.normal) > kSameWay) {
      explained += 1 - part * part;
    }
    wrong += inside(gap, limit);
  }
  for (const auto& sample : patch.beside) {
    const Vector3d point = move * sample.point;
    const Surfel* surfel = bottom.at(point);
    if (surfel == nullptr) continue;
    wrong += patch.beside_weight * inside(surfel->normal.dot(surfel->point - point), limit);
  }
  return (explained - kInside * wrong) / static_cast<double>(patch.core.size());
}

Motion twisted(const Motion& move, const ContactPatch& patch, const Twist& twist) {
  // The twist is the object's: in the object's frame the contact moves the other way.
  Motion back = Motion::Identity();
  back.linear() = rotation_by(-twist.head<3>() / patch.arm);
  back.translation() = patch.middle - back.linear() * (patch.middle + twist.tail<3>());
  return move * back;
}

ScoredPose hill_climb(const BottomView& bottom, const ContactPatch& patch, const Motion& move,
                      double step, double last) {
  double limit = std::max(kFineLimit, step / 2);
  ScoredPose best{move, score_of(bottom, patch, move, limit)};
  while (step > last) {
    bool better = false;
    for (int axis = 0; axis < 6; ++axis) {
      for (const double sign : {1.0, -1.0}) {
        Twist twist = Twist::Zero();
        twist[axis] = sign * step;
        const Motion tried = twisted(best.move, patch, twist);
        const double score = score_of(bottom, patch, tried, limit);
        if (score <= best.score) continue;
        best = {tried, score};
        better = true;
        break;
      }
    }
    if (better) continue;
    step /= 2;
    limit = std::max(kFineLimit, step / 2);
    best.score = score_of(bottom, patch, best.move, limit);
  }
  return best;
}

std::vector<Twist> unobservable_twists(const BottomView& bottom, const ContactPatch& patch,
                                       const Motion& move) {
  constexpr double kShift = 2.5e-4;
  constexpr double kLimit = 1e-4;
  constexpr double kChange = 0.03;
  // Directions that the shape in contact does not show, by distances along the normals alone.
  Matrix6 shape = Matrix6::Zero();
  double count = 0;
  for (const auto& sample : patch.core) {
    const Surfel* surfel = bottom.at(move * sample.point);
    if (surfel == nullptr) continue;
    const Vector3d normal = move.linear().transpose() * surfel->normal;
    Twist row;
    row << (sample.point - patch.middle).cross(normal) / patch.arm, normal;
    shape += row * row.transpose();
    ++count;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6> shown(shape / std::max(1.0, count));
  constexpr double kSeen = 0.003;
  std::vector<Twist> unseen;
  for (int k = 0; k < 6; ++k) {
    if (shown.eigenvalues()[k] < kSeen) unseen.emplace_back(shown.eigenvectors().col(k));
  }
  // Along these only the outline makes the score fall, nearly as a quadratic form.
  const double here = score_of(bottom, patch, move, kLimit);
  const auto fall = [&](const Twist& direction) {
    const double there = score_of(bottom, patch, twisted(move, patch, kShift * direction), kLimit);
    const double back = score_of(bottom, patch, twisted(move, patch, -kShift * direction), kLimit);
    return here - (there + back) / 2;
  };
  const auto size = static_cast<Eigen::Index>(unseen.size());
  Eigen::MatrixXd form(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const Twist& one = unseen[static_cast<std::size_t>(i)];
    form(i, i) = fall(one);
    for (Eigen::Index k = 0; k < i; ++k) {
      const Twist& other = unseen[static_cast<std::size_t>(k)];
      const double along = fall((one + other) / std::numbers::sqrt2);
      const double across = fall((one - other) / std::numbers::sqrt2);
      form(i, k) = form(k, i) = (along - across) / 2;
    }
  }
  if (size == 0) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> outline(form);
  std::vector<Twist> unobservable;
  for (Eigen::Index k = 0; k < size; ++k) {
    if (outline.eigenvalues()[k] >= kChange) continue;
    Twist direction = Twist::Zero();
    for (Eigen::Index i = 0; i < size; ++i) {
      direction += outline.eigenvectors()(i, k) * unseen[static_cast<std::size_t>(i)];
    }
    unobservable.push_back(direction);
  }
  return unobservable;
}

}  // namespace dtact::perceive
