#include "clients/perceive/pose/contact_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace dtact::perceive {
namespace {

/// What is shallower than this part of the deepest is taken for gel that follows the object without
/// touching it.
constexpr float kTouchingPart = 0.3F;
/// And so is what noise alone may press in.
constexpr double kUncertainties = 3;
/// Pixels to each side that the normals' change is taken over.
constexpr int kBendPixels = 3;
/// Normals are told apart by their x and y, in so many steps each.
constexpr int kDirections = 12;

}  // namespace

ContactView::ContactView(const DepthGrid& depth, const PointCloud& cloud, double uncertainty_um)
    : cloud_(cloud),
      touching_(cloud.size()),
      px_(depth.mm_per_px * 1e-3),
      x0_((depth.x - 0.5 * (depth.full_width - 1)) * px_),
      y0_((depth.y - 0.5 * (depth.full_height - 1)) * px_) {
  const auto z = cloud.part(PointCloud::kZ);
  float deepest = 0;
  for (const float value : z) {
    if (-value > deepest) deepest = -value;  // false for NaN
  }
  const float threshold =
      std::max(static_cast<float>(kUncertainties * uncertainty_um * 1e-6), kTouchingPart * deepest);
  for (int row = 0; row < cloud.height; ++row) {
    for (int column = 0; column < cloud.width; ++column) {
      const std::size_t i = index(column, row);
      if (!(-z[i] > threshold)) continue;
      touching_[i] = 1;
      ++pixels_;
      centre_ += Eigen::Vector3d(x0_ + column * px_, y0_ + row * px_, z[i]);
    }
  }
  if (pixels_ > 0) centre_ /= static_cast<double>(pixels_);
}

std::optional<ContactView::Sample> ContactView::at(double x, double y) const {
  const double column = (x - x0_) / px_;
  const double row = (y - y0_) / px_;
  if (!(column >= kBendPixels && row >= kBendPixels && column < cloud_.width - 1 - kBendPixels &&
        row < cloud_.height - 1 - kBendPixels)) {
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
  sample.normal.setZero();
  for (std::size_t k = 0; k < 4; ++k) {
    if (touching_[corners[k]] == 0) return std::nullopt;
    sample.z += weights[k] * cloud_.part(PointCloud::kZ)[corners[k]];
    sample.normal += weights[k] * normal(corners[k]);
  }
  sample.normal.normalize();
  const std::array<std::size_t, 4> around{index(c - kBendPixels, r), index(c + kBendPixels, r),
                                          index(c, r - kBendPixels), index(c, r + kBendPixels)};
  for (const std::size_t one : around) {
    if (touching_[one] == 0) return sample;
  }
  const double span = 2 * kBendPixels * px_;
  Eigen::Matrix2d& bend = sample.bend.emplace();
  bend.col(0) = (normal(around[1]) - normal(around[0])).head<2>() / span;
  bend.col(1) = (normal(around[3]) - normal(around[2])).head<2>() / span;
  return sample;
}

std::vector<Surfel> ContactView::choose(std::size_t most) const {
  std::array<std::vector<std::size_t>, std::size_t{kDirections} * kDirections> by_direction;
  const auto step = [](float component) {
    return std::clamp(static_cast<int>((component + 1) / 2 * kDirections), 0, kDirections - 1);
  };
  for (std::size_t i = 0; i < touching_.size(); ++i) {
    if (touching_[i] == 0) continue;
    const int direction = step(cloud_.part(PointCloud::kNormalY)[i]) * kDirections +
                          step(cloud_.part(PointCloud::kNormalX)[i]);
    by_direction[static_cast<std::size_t>(direction)].push_back(i);
  }
  // Those with few give all they have, and leave more to the others.
  std::sort(by_direction.begin(), by_direction.end(),
            [](const auto& a, const auto& b) { return a.size() < b.size(); });
  std::vector<Surfel> chosen;
  for (std::size_t bin = 0; bin < by_direction.size(); ++bin) {
    const auto& pixels = by_direction[bin];
    const std::size_t share = (most - chosen.size()) / (by_direction.size() - bin);
    const std::size_t count = std::min(share, pixels.size());
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = pixels[k * pixels.size() / count];
      chosen.push_back({{cloud_.part(PointCloud::kX)[i], cloud_.part(PointCloud::kY)[i],
                         cloud_.part(PointCloud::kZ)[i]},
                        normal(i)});
    }
  }
  return chosen;
}

}  // namespace dtact::perceive
