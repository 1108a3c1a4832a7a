#include "clients/perceive/recognition/touch_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace dtact::perceive {
namespace {

constexpr double kContactUm = 100;  // the daemon's default

}  // namespace

TouchMap touch_map(const DepthGrid& depth) {
  TouchMap map;
  const double um = depth.um_per_unit;
  const auto value = [&](int x, int y) {
    const int unit =
        depth.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.width) +
                     static_cast<std::size_t>(x)];
    return unit == depth.untrusted ? 0.0 : unit * um;
  };
  double sum = 0;
  double sum_x = 0;
  double sum_y = 0;
  double deepest_um = 0;
  int pixels = 0;
  int on_border = 0;
  for (int y = 0; y < depth.height; ++y) {
    const bool end_row = y == 0 || y == depth.height - 1;
    for (int x = 0; x < depth.width; ++x) {
      const double here = value(x, y);
      if (here < kContactUm) continue;
      ++pixels;
      if (end_row || x == 0 || x == depth.width - 1) ++on_border;
      deepest_um = std::max(deepest_um, here);
      sum += here;
      sum_x += here * x;
      sum_y += here * y;
    }
  }
  if (pixels == 0) return map;
  map.deepest_mm = 1e-3 * deepest_um;
  map.area_mm2 = pixels * depth.mm_per_px * depth.mm_per_px;
  map.cut = on_border / std::sqrt(static_cast<double>(pixels));

  // Each pixel is shared among the four cells around it.
  constexpr int kSide = TouchMap::kSide;
  std::array<float, std::size_t{kSide} * kSide> weights{};
  const double cells = depth.mm_per_px / TouchMap::kCellMm;
  const double left = (kSide - 1) / 2.0 - cells * sum_x / sum;
  const double top = (kSide - 1) / 2.0 - cells * sum_y / sum;
  for (int y = 0; y < depth.height; ++y) {
    const double row = top + cells * y;
    const int r = static_cast<int>(std::floor(row));
    if (r < 0 || r >= kSide - 1) continue;
    const auto fy = static_cast<float>(row - r);
    for (int x = 0; x < depth.width; ++x) {
      const double column = left + cells * x;
      const int c = static_cast<int>(std::floor(column));
      if (c < 0 || c >= kSide - 1) continue;
      const auto fx = static_cast<float>(column - c);
      const auto mm = static_cast<float>(1e-3 * value(x, y));
      const auto i = static_cast<std::size_t>(r) * kSide + static_cast<std::size_t>(c);
      const auto add = [&](std::size_t cell, float weight) {
        map.mm[cell] += weight * mm;
        weights[cell] += weight;
      };
      add(i, (1 - fx) * (1 - fy));
      add(i + 1, fx * (1 - fy));
      add(i + kSide, (1 - fx) * fy);
      add(i + kSide + 1, fx * fy);
    }
  }
  for (std::size_t i = 0; i < map.mm.size(); ++i) {
    // Less is a cell beyond the depth map.
    constexpr float kMinWeight = 0.1F;
    map.mm[i] = weights[i] < kMinWeight
                    ? 0
                    : std::clamp(map.mm[i] / weights[i], TouchMap::kMinMm, TouchMap::kMaxMm);
  }
  return map;
}

}  // namespace dtact::perceive
