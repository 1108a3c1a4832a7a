#include "clients/calibrate/fit/contact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>

namespace dtact::calibration {
namespace {

constexpr double kMinPeak = 8;     // grey levels, about 0.25 mm: a LUT from less is noise
constexpr double kEdgeLevels = 3;  // the contact's edge, as the published circle detection has it
constexpr double kMaxOfBall = 0.85;
constexpr double kPatch = 0.3;  // of the peak: on the flank, where neither noise nor ring reach
constexpr int kTile = 40;       // pixels

std::size_t index(const DarkeningMap& map, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) +
         static_cast<std::size_t>(x);
}

/// Pixels connected to `seed` over sides whose level exceeds `threshold`.
std::vector<std::size_t> patch_around(const DarkeningMap& map, std::size_t seed, double threshold) {
  std::vector<bool> seen(map.levels.size());
  std::vector<std::size_t> patch{seed};
  seen[seed] = true;
  const auto visit = [&](std::size_t pixel) {
    if (seen[pixel] || !(map.levels[pixel] > threshold)) return;
    seen[pixel] = true;
    patch.push_back(pixel);
  };
  const auto width = static_cast<std::size_t>(map.width);
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const std::size_t pixel = patch[i];
    if (pixel % width > 0) visit(pixel - 1);
    if (pixel % width + 1 < width) visit(pixel + 1);
    if (pixel >= width) visit(pixel - width);
    if (pixel + width < map.levels.size()) visit(pixel + width);
  }
  return patch;
}

double contact_radius(const RadialProfile& profile, double limit) {
  for (std::size_t i = 1; i < profile.levels.size(); ++i) {
    const double inner = profile.levels[i - 1];
    const double outer = profile.levels[i];
    if (!(outer < kEdgeLevels)) continue;
    const double part = (inner - kEdgeLevels) / (inner - outer);
    return std::min(limit, (static_cast<double>(i) - 0.5 + part) * profile.step_mm);
  }
  return limit;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace

double RadialProfile::at(double radius_mm) const {
  const double place =
      std::clamp(radius_mm / step_mm - 0.5, 0.0, static_cast<double>(levels.size()) - 1);
  const auto inner = static_cast<std::size_t>(place);
  const std::size_t outer = std::min(inner + 1, levels.size() - 1);
  return std::lerp(levels[inner], levels[outer], place - static_cast<double>(inner));
}

double sag_mm(double ball_radius_mm, double r) noexcept {
  return ball_radius_mm - std::sqrt(std::max(0.0, ball_radius_mm * ball_radius_mm - r * r));
}

double distance_mm(const DarkeningMap& map, const Contact& contact, int x, int y) {
  return std::hypot(x - contact.col, y - contact.row) * map.mm_per_px;
}

RadialProfile radial_profile(const DarkeningMap& map, const Contact& contact, double reach_mm) {
  // Two pixels a ring: the finest that leaves no ring empty, up to the middle one.
  RadialProfile profile{2 * map.mm_per_px, {}, {}};
  const auto rings = static_cast<std::size_t>(std::ceil(reach_mm / profile.step_mm));
  profile.levels.resize(rings);
  profile.shown.resize(rings);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double ring = distance_mm(map, contact, x, y) / profile.step_mm;
      const float level = map.at(x, y);
      if (ring >= static_cast<double>(rings) || std::isnan(level)) continue;
      profile.levels[static_cast<std::size_t>(ring)] += level;
      profile.shown[static_cast<std::size_t>(ring)] += 1;
    }
  }
  for (std::size_t i = 0; i < rings; ++i) {
    profile.levels[i] /= profile.shown[i];
    // Area of the ring in pixels: π·((i + 1)² − i²) · 2².
    profile.shown[i] /= 4 * std::numbers::pi * (2 * static_cast<double>(i) + 1);
  }
  return profile;
}

Contact find_contact(const DarkeningMap& map, double ball_radius_mm) {
  std::size_t seed = 0;
  float peak = -std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < map.levels.size(); ++i) {
    if (map.levels[i] > peak) {
      peak = map.levels[i];
      seed = i;
    }
  }
  if (!(peak >= kMinPeak)) {
    throw NoContact(fmt::format(
        "no contact found: nowhere is the frame darker than the reference by {} grey levels (the "
        "most is {:.1f}); press deeper, and check that reference and frame are not exchanged",
        kMinPeak, peak));
  }
  Contact contact;
  contact.ball_radius_mm = ball_radius_mm;
  contact.peak_levels = peak;
  double weight = 0;
  const auto width = static_cast<std::size_t>(map.width);
  for (const std::size_t pixel : patch_around(map, seed, kPatch * peak)) {
    const double level = map.levels[pixel];
    weight += level;
    contact.col += level * static_cast<double>(pixel % width);
    const std::size_t row = pixel / width;
    contact.row += level * static_cast<double>(row);
  }
  contact.col /= weight;
  contact.row /= weight;

  const double limit = kMaxOfBall * ball_radius_mm;
  contact.radius_mm = contact_radius(radial_profile(map, contact, limit + 1), limit);
  const double pixels = contact.radius_mm / map.mm_per_px;
  if (contact.col < pixels || contact.row < pixels || contact.col > map.width - 1 - pixels ||
      contact.row > map.height - 1 - pixels) {
    throw std::runtime_error(
        fmt::format("the contact (centre at column {:.0f}, row {:.0f} of the depth map, radius "
                    "{:.0f} pixels) leaves the map of {}x{}; press nearer to the middle, or give "
                    "another --centre and --crop",
                    contact.col, contact.row, pixels, map.width, map.height));
  }
  return contact;
}

double far_field_drift(const DarkeningMap& map, const Contact& contact) {
  std::vector<double> tiles;
  int left = 0;
  int above = 0;
  for (int top = 0; top + kTile <= map.height; top += kTile) {
    for (int start = 0; start + kTile <= map.width; start += kTile) {
      double sum = 0;
      int count = 0;
      for (int y = top; y < top + kTile; ++y) {
        for (int x = start; x < start + kTile; ++x) {
          const float level = map.levels[index(map, x, y)];
          if (std::isnan(level) ||
              distance_mm(map, contact, x, y) < kFarField * contact.ball_radius_mm) {
            continue;
          }
          sum += level;
          ++count;
        }
      }
      if (count < kTile * kTile / 2) continue;
      tiles.push_back(sum / count);
      left += static_cast<int>(start < contact.col);
      above += static_cast<int>(top < contact.row);
    }
  }
  const auto all = static_cast<int>(tiles.size());
  const bool both_sides = (left > 0 && left < all) || (above > 0 && above < all);
  if (all < 8 || !both_sides) return 0;
  const double middle = median(tiles);
  double spread = 0;
  for (const double tile : tiles) spread += (tile - middle) * (tile - middle);
  spread = std::sqrt(spread / all);
  return std::abs(middle) >= std::max(0.5, 2 * spread) ? middle : 0;
}

}  // namespace dtact::calibration
