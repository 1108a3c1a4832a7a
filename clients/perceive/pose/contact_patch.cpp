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
/// What is shallower than this part of the deepest is no core.
constexpr double kCorePart = 0.3;
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
  patch.frame.linear() << side, up.cross(side), up;
  patch.frame.translation() = view.centre();
  const int width = view.cloud().width;
  const int height = view.cloud().height;
  std::vector<std::uint8_t> is_core(view.cloud().size());
  std::size_t core = 0;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const std::size_t i = view.index(column, row);
      if (!(view.depth(i) > kCorePart * view.deepest()) || !view.is_core(column, row)) continue;
      is_core[i] = 1;
      ++core;
    }
  }
  if (core == 0) return patch;
  patch.area = static_cast<double>(core) * view.px() * view.px();
  // Takes every `stride`-th pixel along both sides, for core and beside.
  const int stride = std::max(1, static_cast<int>(std::ceil(std::sqrt(
                                     static_cast<double>(core) / static_cast<double>(kCore)))));
  const Motion back = patch.frame.inverse();
  for (int row = stride / 2; row < height; row += stride) {
    for (int column = stride / 2; column < width; column += stride) {
      const std::size_t i = view.index(column, row);
      if (!view.cloud().has(i)) continue;
      (is_core[i] != 0 ? patch.core : patch.beside)
          .push_back({back * view.point(i), back.linear() * view.normal(i)});
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
