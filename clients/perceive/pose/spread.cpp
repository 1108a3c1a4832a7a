#include "clients/perceive/pose/spread.hpp"

#include <algorithm>
#include <array>
#include <numeric>

namespace dtact::perceive {
namespace {

/// Normals are told apart by their x and y, in so many steps each.
constexpr int kStepsEach = 12;

}  // namespace

std::vector<std::size_t> spread(std::span<const Eigen::Vector3d> normals, std::size_t most) {
  std::array<std::vector<std::size_t>, std::size_t{kStepsEach} * kStepsEach> by_direction;
  const auto step = [](double component) {
    return std::clamp(static_cast<int>((component + 1) / 2 * kStepsEach), 0, kStepsEach - 1);
  };
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const int direction = step(normals[i].y()) * kStepsEach + step(normals[i].x());
    by_direction.at(static_cast<std::size_t>(direction)).push_back(i);
  }
  // Those with few give all they have, and leave more to the others.
  std::array<std::size_t, by_direction.size()> order{};
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t bin) { return by_direction.at(bin).size(); });
  std::vector<std::size_t> chosen;
  std::size_t left = order.size();
  for (const std::size_t bin : order) {
    const auto& alike = by_direction.at(bin);
    const std::size_t share = (most - chosen.size()) / left--;
    const std::size_t count = std::min(share, alike.size());
    for (std::size_t k = 0; k < count; ++k) chosen.push_back(alike[k * alike.size() / count]);
  }
  return chosen;
}

}  // namespace dtact::perceive
