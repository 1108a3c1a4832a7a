#include "clients/calibrate/fit/published.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace dtact::calibration {
namespace {

constexpr int kCircleLevels = 3;    // circle_detect_gray of the authors' configuration
constexpr int kThresholdLevel = 2;  // their lighting_threshold

bool holds(const Circle& circle, Pixel p) {
  return std::hypot(p.col - circle.col, p.row - circle.row) <= circle.radius + 1e-9;
}

Circle through(Pixel a, Pixel b) {
  return {0.5 * (a.col + b.col), 0.5 * (a.row + b.row),
          0.5 * std::hypot(a.col - b.col, a.row - b.row)};
}

Circle through(Pixel a, Pixel b, Pixel c) {
  const double bx = b.col - a.col;
  const double by = b.row - a.row;
  const double cx = c.col - a.col;
  const double cy = c.row - a.row;
  const double cross = 2 * (bx * cy - by * cx);
  if (cross == 0) {  // on one line: use the two farthest apart
    const std::array<Circle, 3> pairs{through(a, b), through(a, c), through(b, c)};
    return *std::ranges::max_element(pairs, {}, &Circle::radius);
  }
  const double b2 = bx * bx + by * by;
  const double c2 = cx * cx + cy * cy;
  const double x = (cy * b2 - by * c2) / cross;
  const double y = (bx * c2 - cx * b2) / cross;
  return {a.col + x, a.row + y, std::hypot(x, y)};
}

/// |reference − ball| where the ball is darker, else 0.
std::vector<int> darkening(const image::Grey8& reference, const image::Grey8& ball) {
  std::vector<int> levels(ball.pixels.size());
  std::ranges::transform(reference.pixels, ball.pixels, levels.begin(),
                         [](int before, int now) { return std::max(0, before - now); });
  return levels;
}

/// The largest patch of 8-connected pixels above the circle's threshold.
std::vector<Pixel> largest_patch(const std::vector<int>& levels, int width, int height) {
  std::vector<bool> seen(levels.size());
  const auto fresh = [&](int col, int row) {
    if (col < 0 || row < 0 || col >= width || row >= height) return false;
    const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                   static_cast<std::size_t>(col);
    const bool is = !seen[i] && levels[i] > kCircleLevels;
    if (is) seen[i] = true;
    return is;
  };
  std::vector<Pixel> largest;
  for (int row = 0; row < height; ++row) {
    for (int col = 0; col < width; ++col) {
      if (!fresh(col, row)) continue;
      std::vector<Pixel> patch{{col, row}};
      for (std::size_t i = 0; i < patch.size(); ++i) {
        const Pixel p = patch[i];
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            if (fresh(p.col + dx, p.row + dy)) patch.push_back({p.col + dx, p.row + dy});
          }
        }
      }
      if (patch.size() > largest.size()) largest = std::move(patch);
    }
  }
  return largest;
}

/// Fills entries without pixels by interpolation between their neighbours; the ends are held.
void fill_gaps(std::vector<double>& depth, const std::vector<int>& count) {
  const auto known = [&](std::size_t i) { return count[i] > 0; };
  std::size_t before = 0;
  while (!known(before)) ++before;
  std::fill(depth.begin(), depth.begin() + static_cast<std::ptrdiff_t>(before), depth[before]);
  for (std::size_t i = before + 1; i < depth.size(); ++i) {
    if (!known(i)) continue;
    for (std::size_t gap = before + 1; gap < i; ++gap) {
      depth[gap] = std::lerp(depth[before], depth[i],
                             static_cast<double>(gap - before) / static_cast<double>(i - before));
    }
    before = i;
  }
}

}  // namespace

Circle enclosing_circle(std::vector<Pixel> points) {
  if (points.empty()) return {};
  // Only the ends of each row can be on the circle, and they are few.
  std::ranges::sort(
      points, [](Pixel a, Pixel b) { return a.row != b.row ? a.row < b.row : a.col < b.col; });
  std::vector<Pixel> ends;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool first = i == 0 || points[i - 1].row != points[i].row;
    const bool last = i + 1 == points.size() || points[i + 1].row != points[i].row;
    if (first || last) ends.push_back(points[i]);
  }
  Circle circle{static_cast<double>(ends[0].col), static_cast<double>(ends[0].row), 0};
  for (std::size_t i = 1; i < ends.size(); ++i) {
    if (holds(circle, ends[i])) continue;
    circle = {static_cast<double>(ends[i].col), static_cast<double>(ends[i].row), 0};
    for (std::size_t j = 0; j < i; ++j) {
      if (holds(circle, ends[j])) continue;
      circle = through(ends[i], ends[j]);
      for (std::size_t k = 0; k < j; ++k) {
        if (!holds(circle, ends[k])) circle = through(ends[i], ends[j], ends[k]);
      }
    }
  }
  return circle;
}

Circle published_circle(const image::Grey8& reference, const image::Grey8& ball) {
  const std::vector<int> levels = darkening(reference, ball);
  const Circle found = enclosing_circle(largest_patch(levels, ball.width, ball.height));
  return {std::trunc(found.col), std::trunc(found.row), std::trunc(found.radius)};
}

recon::DepthLut fit_published(const image::Grey8& reference, const image::Grey8& ball,
                              double ball_radius_mm, double mm_per_px) {
  const std::vector<int> levels = darkening(reference, ball);
  const auto [col, row, radius] = published_circle(reference, ball);
  if (radius < 1) {
    throw std::runtime_error(
        "no contact found: nothing is darker than the reference by more than "
        "3 grey levels; press deeper");
  }
  const double edge = ball_radius_mm * ball_radius_mm - std::pow(radius * mm_per_px, 2);
  if (edge <= 0) {
    throw std::runtime_error(fmt::format(
        "the contact circle (radius {:.2f} mm) is wider than the ball ({} mm); check the scale",
        radius * mm_per_px, ball_radius_mm));
  }
  const auto entries = static_cast<std::size_t>(std::ranges::max(levels)) + 1;
  std::vector<double> depth(entries);
  std::vector<int> count(entries);
  std::size_t pixel = 0;
  for (int y = 0; y < ball.height; ++y) {
    for (int x = 0; x < ball.width; ++x, ++pixel) {
      const double r2 = (std::pow(x - col, 2) + std::pow(y - row, 2)) * mm_per_px * mm_per_px;
      const double mm =
          std::sqrt(std::max(0.0, ball_radius_mm * ball_radius_mm - r2)) - std::sqrt(edge);
      if (mm <= 0) continue;
      depth[static_cast<std::size_t>(levels[pixel])] += mm;
      ++count[static_cast<std::size_t>(levels[pixel])];
    }
  }
  for (std::size_t i = 0; i < entries; ++i) depth[i] /= std::max(1, count[i]);
  // Nothing is filled beyond the circle's greatest darkening.
  const auto last = std::ranges::find_if(count.rbegin(), count.rend(), [](int n) { return n > 0; });
  depth.resize(static_cast<std::size_t>(count.rend() - last));
  fill_gaps(depth, count);

  return published_lut(depth);
}

recon::DepthLut published_lut(const std::vector<double>& depth_mm) {
  recon::DepthLut lut;
  const double zero = depth_mm[std::min<std::size_t>(kThresholdLevel, depth_mm.size() - 1)];
  constexpr int kStep = recon::kEntriesPerLevel;
  const int last_level = static_cast<int>(depth_mm.size()) - 1;
  for (int q6 = 0; q6 <= last_level * kStep; ++q6) {
    const int level = (q6 + kStep / 2) / kStep;
    const double mm = level <= kThresholdLevel
                          ? 0
                          : std::max(0.0, depth_mm[static_cast<std::size_t>(level)] - zero);
    lut.um.push_back(static_cast<std::int16_t>(std::min(16383L, std::lround(1000 * mm))));
  }
  lut.covered_to_q6 = last_level * kStep;
  return lut;
}

}  // namespace dtact::calibration
