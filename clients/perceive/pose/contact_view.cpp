#include "clients/perceive/pose/contact_view.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "clients/perceive/pose/spread.hpp"

namespace dtact::perceive {
namespace {

/// What is shallower than this part of the deepest is taken for gel that follows the object without
/// touching it.
constexpr double kTouchingPart = 0.3;
/// And so is what noise alone may press in: so many times the uncertainty, which is more of bias
/// and blur than of noise, and at most three deviations of the most noise that an untouched map
/// has.
constexpr double kUncertainties = 3;
constexpr double kMostNoiseUm = 30;
/// The normals' change is taken over so far to each side, metres: 3 pixels of 0.0414 mm.
constexpr double kBendReach = 1.3e-4;

}  // namespace

ContactView::ContactView(const DepthGrid& depth, const PointCloud& cloud, const SurfaceTable* table,
                         double uncertainty_um)
    : cloud_(cloud),
      table_(table),
      touching_(cloud.size()),
      px_(depth.mm_per_px * 1e-3),
      reach_(std::max(1, static_cast<int>(std::lround(kBendReach / px_)))),
      x0_((depth.x - 0.5 * (depth.full_width - 1)) * px_),
      y0_((depth.y - 0.5 * (depth.full_height - 1)) * px_) {
  int deepest = 0;
  for (const std::int16_t value : depth.values) {
    if (value != depth.untrusted) deepest = std::max(deepest, int{value});
  }
  const double noise_um = std::min(kUncertainties * uncertainty_um, kMostNoiseUm);
  const double threshold = std::max(noise_um / depth.um_per_unit, kTouchingPart * deepest);
  deepest_ = 1e-6 * deepest * depth.um_per_unit;
  for (int row = 0; row < cloud.height; ++row) {
    for (int column = 0; column < cloud.width; ++column) {
      const std::size_t i = index(column, row);
      if (depth.values[i] == depth.untrusted || !(depth.values[i] > threshold) || !cloud.has(i)) {
        continue;
      }
      touching_[i] = 1;
      ++pixels_;
      centre_ += point(i);
      if (table_ != nullptr) upright_ += upright_at(column, row);
    }
  }
  if (pixels_ > 0) centre_ /= static_cast<double>(pixels_);
  if (upright_.isZero()) upright_ = Eigen::Vector3d::UnitZ();
  upright_.normalize();
}

Eigen::Vector3d ContactView::upright_at(int column, int row) const {
  const std::size_t i =
      static_cast<std::size_t>(cloud_.y + row) * static_cast<std::size_t>(table_->width) +
      static_cast<std::size_t>(cloud_.x + column);
  return {table_->normal[0][i], table_->normal[1][i], table_->normal[2][i]};
}

std::optional<ContactView::Place> ContactView::place_of(const Eigen::Vector3d& point) const {
  if (table_ == nullptr) return Place{(point.x() - x0_) / px_, (point.y() - y0_) / px_};
  const auto foot = foot_of(*table_, {point.x(), point.y(), point.z()});
  if (!foot) return std::nullopt;
  const Eigen::Vector3d upright(foot->normal[0], foot->normal[1], foot->normal[2]);
  return Place{foot->column - cloud_.x, foot->row - cloud_.y, upright.normalized()};
}

std::optional<ContactView::Bend> ContactView::bend_at(int column, int row,
                                                      const Eigen::Vector3d& upright) const {
  const std::array<std::size_t, 4> around{index(column - reach_, row), index(column + reach_, row),
                                          index(column, row - reach_), index(column, row + reach_)};
  for (const std::size_t one : around) {
    if (touching_[one] == 0) return std::nullopt;
  }
  Bend bend;
  const Eigen::Vector3d side = (Eigen::Vector3d::UnitX() - upright.x() * upright).normalized();
  bend.axes << side, upright.cross(side);
  const auto along = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    return Eigen::Vector2d(bend.axes.transpose() * (to - from));
  };
  Eigen::Matrix2d normals;
  normals << along(normal(around[0]), normal(around[1])),
      along(normal(around[2]), normal(around[3]));
  // How far apart the pixels lie at the object's depth.
  Eigen::Matrix2d places;
  places << along(point(around[0]), point(around[1])), along(point(around[2]), point(around[3]));
  bend.change = normals * places.inverse() * bend.axes.transpose();
  return bend;
}

std::optional<ContactView::Sample> ContactView::at(const Eigen::Vector3d& point_m) const {
  const std::optional<Place> place = place_of(point_m);
  if (!place ||
      !(place->column >= reach_ && place->row >= reach_ &&
        place->column < cloud_.width - 1 - reach_ && place->row < cloud_.height - 1 - reach_)) {
    return std::nullopt;
  }
  const int c = static_cast<int>(place->column);
  const int r = static_cast<int>(place->row);
  const double fx = place->column - c;
  const double fy = place->row - r;
  const std::size_t i = index(c, r);
  const auto width = static_cast<std::size_t>(cloud_.width);
  const std::array<std::size_t, 4> corners{i, i + 1, i + width, i + width + 1};
  const std::array<double, 4> weights{(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
  Sample sample;
  sample.normal.setZero();
  for (std::size_t k = 0; k < 4; ++k) {
    if (touching_[corners[k]] == 0) return std::nullopt;
    sample.point += weights[k] * point(corners[k]);
    sample.normal += weights[k] * normal(corners[k]);
  }
  sample.normal.normalize();
  sample.bend = bend_at(c, r, place->upright);
  return sample;
}

std::vector<Surfel> ContactView::choose(std::size_t most) const {
  std::vector<std::size_t> pixels;
  std::vector<Eigen::Vector3d> normals;
  pixels.reserve(pixels_);
  normals.reserve(pixels_);
  for (std::size_t i = 0; i < touching_.size(); ++i) {
    if (touching_[i] == 0) continue;
    pixels.push_back(i);
    normals.push_back(normal(i));
  }
  std::vector<Surfel> chosen;
  for (const std::size_t k : spread(normals, most))
    chosen.push_back({point(pixels[k]), normals[k]});
  return chosen;
}

}  // namespace dtact::perceive
