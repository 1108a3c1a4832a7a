#include "clients/perceive/pose/contact_view.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace dtact::perceive {
namespace {

/// Three standard deviations of a reference map's noise, metres. kPressedShare: the error of an
/// aged reference, as a share of the deepest point.
constexpr double kNoise = 3e-5;
constexpr double kPressedShare = 0.05;
/// The depth's curvature is taken over so far to both sides, metres.
constexpr double kReach = 3.5e-4;
/// A sum of both second derivatives of the depth above this is a shoulder, 1/metre: what noise does
/// not reach.
constexpr double kHollow = 250;

}  // namespace

using Eigen::Vector3d;

ContactView::ContactView(const DepthGrid& depth, const PointCloud& cloud, const SurfaceTable* table,
                         double uncertainty_um, const recon::Viewpoint& view)
    : depth_(depth),
      cloud_(cloud),
      table_(table),
      px_(depth.mm_per_px * 1e-3),
      x0_((depth.x - 0.5 * (depth.full_width - 1)) * px_),
      y0_((depth.y - 0.5 * (depth.full_height - 1)) * px_),
      uncertainty_(1e-6 * uncertainty_um),
      view_(view) {
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (this->depth(i) > deepest_) deepest_ = this->depth(i);
  }
  pressed_ = std::max(kNoise, kPressedShare * deepest_);
  for (int row = 0; row < cloud.height; ++row) {
    for (int column = 0; column < cloud.width; ++column) {
      const std::size_t i = index(column, row);
      if (!is_pressed(i)) continue;
      ++pixels_;
      centre_ += point(i);
      if (table_ != nullptr) upright_ += upright_at(column, row);
    }
  }
  if (pixels_ > 0) centre_ /= static_cast<double>(pixels_);
  if (upright_.isZero()) upright_ = Vector3d::UnitZ();
  upright_.normalize();
}

double ContactView::depth(std::size_t i) const noexcept {
  const std::int16_t value = depth_.values[i];
  if (value == depth_.untrusted || !cloud_.has(i)) return std::numeric_limits<double>::quiet_NaN();
  return 1e-6 * depth_.um_per_unit * value;
}

Vector3d ContactView::upright_at(int column, int row) const {
  const std::size_t i =
      static_cast<std::size_t>(cloud_.y + row) * static_cast<std::size_t>(table_->width) +
      static_cast<std::size_t>(cloud_.x + column);
  return {table_->normal[0][i], table_->normal[1][i], table_->normal[2][i]};
}

std::optional<ContactView::Sample> ContactView::at(const Vector3d& point_m) const {
  const recon::Point seen = view_.seen({1e3 * point_m.x(), 1e3 * point_m.y()}, -1e3 * point_m.z());
  double column = (1e-3 * seen.x - x0_) / px_;
  double row = (1e-3 * seen.y - y0_) / px_;
  Vector3d upright = Vector3d::UnitZ();
  if (table_ != nullptr) {
    const auto projection = project_to_surface(*table_, {point_m.x(), point_m.y(), point_m.z()});
    if (!projection) return std::nullopt;
    column = projection->column - cloud_.x;
    row = projection->row - cloud_.y;
    upright =
        Vector3d(projection->normal[0], projection->normal[1], projection->normal[2]).normalized();
  }
  if (!(column >= 0 && row >= 0 && column < cloud_.width - 1 && row < cloud_.height - 1)) {
    return std::nullopt;
  }
  const int c = static_cast<int>(column);
  const int r = static_cast<int>(row);
  const double fx = column - c;
  const double fy = row - r;
  const std::size_t i = index(c, r);
  const auto width = static_cast<std::size_t>(cloud_.width);
  const std::array<std::size_t, 4> corners{i, i + 1, i + width, i + width + 1};
  const std::array<double, 4> weights{(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
  Sample sample;
  sample.upright = upright;
  for (std::size_t k = 0; k < 4; ++k) {
    sample.depth += weights[k] * depth(corners[k]);
    sample.point += weights[k] * point(corners[k]);
    sample.normal += weights[k] * normal(corners[k]);
  }
  if (std::isnan(sample.depth)) return std::nullopt;
  sample.normal.normalize();
  sample.below = sample.depth - upright.dot(point_m - sample.point);
  return sample;
}

double ContactView::mean_depth(int column, int row) const {
  double sum = 0;
  for (int r = row - 1; r <= row + 1; ++r) {
    for (int c = column - 1; c <= column + 1; ++c) sum += depth(index(c, r));
  }
  return sum / 9;
}

bool ContactView::is_core(int column, int row) const {
  const int reach = std::max(1, static_cast<int>(std::lround(kReach / px_)));
  if (column <= reach || row <= reach || column + reach + 1 >= cloud_.width ||
      row + reach + 1 >= cloud_.height) {
    return true;
  }
  const double hollow = (mean_depth(column - reach, row) + mean_depth(column + reach, row) +
                         mean_depth(column, row - reach) + mean_depth(column, row + reach) -
                         4 * mean_depth(column, row)) /
                        (reach * px_ * reach * px_);
  return !(hollow > kHollow);
}

std::vector<Surfel> ContactView::surfels(std::size_t count) const {
  const double each = static_cast<double>(pixels_) / static_cast<double>(count);
  const int stride = std::max(1, static_cast<int>(std::lround(std::sqrt(each))));
  std::vector<Surfel> core;
  std::vector<Surfel> shoulder;
  for (int row = stride / 2; row < cloud_.height; row += stride) {
    for (int column = stride / 2; column < cloud_.width; column += stride) {
      const std::size_t i = index(column, row);
      if (!is_pressed(i)) continue;
      (is_core(column, row) ? core : shoulder).push_back({point(i), normal(i), point(i), 1});
    }
  }
  std::vector<Surfel> all = core;
  for (Surfel& surfel : shoulder) {
    const auto distance = [&](const Surfel& one) {
      return (one.point - surfel.point).squaredNorm();
    };
    const auto nearest = std::ranges::min_element(core, {}, distance);
    if (nearest != core.end()) {
      const auto below = [this](const Vector3d& at) {
        const auto sample = this->at(at);
        return sample ? sample->depth : 0.0;
      };
      const double edge = below(nearest->point);
      if (edge > pressed_) {
        surfel.edge = nearest->point;
        surfel.share = std::clamp(below(surfel.point) / edge, 0.0, 1.0);
      }
    }
    all.push_back(surfel);
  }
  return all;
}

}  // namespace dtact::perceive
