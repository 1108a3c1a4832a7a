#include "clients/perceive/pose/contact_patch.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

namespace dtact::perceive {
namespace {

using Eigen::Vector3d;

/// Samples of the core.
constexpr std::size_t kCore = 1500;
/// The gel's bend is taken over so far to both sides, metres.
constexpr double kReach = 3.5e-4;
/// A sum of both second derivatives below this is a shoulder: what noise of 3 µm does not reach,
/// and a finger of 12 mm of radius does not have by itself. 1/metre.
constexpr double kShoulder = -250;

class Grid {
 public:
  explicit Grid(const ContactView& view, const Motion& frame)
      : view_(view), width_(view.cloud().width), height_(view.cloud().height) {
    const std::size_t size = view.cloud().size();
    heights_.assign(size, NAN);
    for (std::size_t i = 0; i < size; ++i) {
      if (!view.cloud().has(i)) continue;
      heights_[i] = frame.rotation.col(2).dot(view.point(i) - frame.translation);
    }
  }

  /// The mean of nine around; NaN beside the map.
  [[nodiscard]] double height(int column, int row) const {
    if (column < 1 || row < 1 || column + 1 >= width_ || row + 1 >= height_) return NAN;
    double sum = 0;
    for (int r = row - 1; r <= row + 1; ++r) {
      for (int c = column - 1; c <= column + 1; ++c) sum += heights_[index(c, r)];
    }
    return sum / 9;
  }
  [[nodiscard]] bool is_core(int column, int row, int reach, double px) const {
    if (!view_.touches(index(column, row))) return false;
    const double bend =
        (height(column - reach, row) + height(column + reach, row) + height(column, row - reach) +
         height(column, row + reach) - 4 * height(column, row)) /
        (reach * px * reach * px);
    return bend > kShoulder;
  }
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(column);
  }

 private:
  const ContactView& view_;
  int width_;
  int height_;
  std::vector<double> heights_;
};

void measure(ContactPatch& patch) {
  std::vector<double> heights;
  for (const auto& sample : patch.core) {
    patch.middle += sample.point / static_cast<double>(patch.core.size());
    heights.push_back(sample.point.z());
  }
  double squares = 0;
  for (const auto& sample : patch.core) squares += (sample.point - patch.middle).squaredNorm();
  patch.arm = std::max(1e-4, std::sqrt(squares / static_cast<double>(patch.core.size())));
  std::ranges::sort(heights);
  patch.lowest = heights[heights.size() / 20];
  patch.highest = heights[heights.size() - 1 - heights.size() / 20];
}

}  // namespace

ContactPatch make_patch(const ContactView& view) {
  ContactPatch patch;
  const Vector3d& up = view.upright();
  const Vector3d side = (Vector3d::UnitX() - up.x() * up).normalized();
  patch.frame.rotation << side, up.cross(side), up;
  patch.frame.translation = view.centre();
  const Grid grid(view, patch.frame);
  const int reach = std::max(1, static_cast<int>(std::lround(kReach / view.px())));
  std::vector<std::pair<int, int>> core;
  const int width = view.cloud().width;
  const int height = view.cloud().height;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      if (grid.is_core(column, row, reach, view.px())) core.emplace_back(column, row);
    }
  }
  if (core.empty()) return patch;
  patch.area = static_cast<double>(core.size()) * view.px() * view.px();
  // Every so many-th pixel of both sides, and so of the places beside.
  const int stride = std::max(
      1, static_cast<int>(
             std::ceil(std::sqrt(static_cast<double>(core.size()) / static_cast<double>(kCore)))));
  const Eigen::Matrix3d back = patch.frame.rotation.transpose();
  std::vector<std::uint8_t> is_core(view.cloud().size());
  for (const auto& [column, row] : core) is_core[grid.index(column, row)] = 1;
  for (int row = stride / 2; row < height; row += stride) {
    for (int column = stride / 2; column < width; column += stride) {
      const std::size_t i = grid.index(column, row);
      if (!view.cloud().has(i)) continue;
      (is_core[i] != 0 ? patch.core : patch.beside)
          .push_back({back * (view.point(i) - patch.frame.translation), back * view.normal(i)});
    }
  }
  if (patch.core.empty()) return patch;
  std::mt19937 random(1);
  std::shuffle(patch.core.begin(), patch.core.end(), random);
  std::shuffle(patch.beside.begin(), patch.beside.end(), random);
  measure(patch);
  return thinned(patch, 2 * kCore);
}

ContactPatch thinned(const ContactPatch& patch, std::size_t most) {
  constexpr std::size_t kBeside = 2;
  ContactPatch some = patch;
  some.core.resize(std::min(most, patch.core.size()));
  some.beside.resize(std::min(kBeside * some.core.size(), patch.beside.size()));
  if (some.beside.empty()) return some;
  const auto part = [](std::size_t a, std::size_t b) {
    return static_cast<double>(a) / static_cast<double>(b);
  };
  some.beside_weight *=
      part(patch.beside.size(), some.beside.size()) * part(some.core.size(), patch.core.size());
  return some;
}

}  // namespace dtact::perceive
