#include "tests/accuracy/pose/sequence.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "hal/sim/scene.hpp"

namespace dtact::pose {
namespace {

using perceive::Motion;

constexpr int kSide = 580;
constexpr int kColumn = 110;  ///< Of the depth map in the image of 800 × 600.
constexpr int kRow = 10;
constexpr double kMmPerPx = 0.0413793;
/// What is deeper belongs to the press; the map has so many pixels around it.
constexpr int kPressedUm = 100;
constexpr int kMargin = 16;
/// Where the ways begin.
constexpr double kStartDeg = 10;
constexpr double kYMm = 0.3;
constexpr double kDepthMm = 0.5;

constexpr double kSeconds = 2;

std::string key(double t, double x, double y, double depth, double rotation, double tilt_y) {
  return fmt::format(
      "  {{ t = {:.9f}, x = {:.9f}, y = {:.9f}, depth = {:.9f}, rotation = {:.9f}, tilt_y = {:.9f} "
      "}},\n",
      t, x, y, depth, rotation, tilt_y);
}

hal::sim::Scene scene_of(const std::string& object, const std::string& keys,
                         const recon::Surface& surface) {
  std::string text;
  if (surface.kind != recon::Surface::Kind::plane) {
    const bool sphere = surface.kind == recon::Surface::Kind::sphere;
    text = fmt::format("[surface]\nshape = \"{}\"\nradius_mm = {:.9f}\ncamera_mm = {:.9f}\n",
                       sphere ? "sphere" : "cylinder", surface.radius_mm,
                       surface.air_mm + surface.gel_mm);
  }
  return hal::sim::parse_scene(fmt::format("{}[[press]]\n{}\n{}", text, object, keys), "sequence");
}

}  // namespace

std::string keys_of(const Way& way, int steps) {
  std::string keys = "keys = [\n";
  for (int step = 0; step <= steps; ++step) {
    const double part = static_cast<double>(step) / steps;
    keys += key(kSeconds * part, (part - 0.5) * way.slide_mm, kYMm, kDepthMm + part * way.deeper_mm,
                kStartDeg + part * way.twist_deg, part * way.roll_deg);
  }
  return keys + "]\n";
}

std::string keys_of_a_minute(int steps) {
  struct Corner {
    double x_mm, y_mm, rotation_deg;
  };
  // Two seconds from one to the next.
  constexpr std::array kRound{Corner{0, 0, 0}, Corner{2, 0, 0}, Corner{0, 2, 0}, Corner{0, 0, 20},
                              Corner{-2, 0, -20}};
  std::string keys = "keys = [\n";
  for (int step = 0; step <= steps; ++step) {
    const double t = 60.0 * step / steps;
    const double whole = std::floor(t / 2);
    const double part = t / 2 - whole;
    const auto at = static_cast<std::size_t>(whole) % kRound.size();
    const Corner& from = kRound.at(at);
    const Corner& to = kRound.at((at + 1) % kRound.size());
    const auto between = [part](double a, double b) { return a + part * (b - a); };
    keys += key(t, between(from.x_mm, to.x_mm), between(from.y_mm, to.y_mm), kDepthMm,
                between(from.rotation_deg, to.rotation_deg), 0);
  }
  return keys + "]\n";
}

Sequence::Sequence(const std::string& object, const std::string& keys,
                   const recon::Surface& surface)
    : truth_(scene_of(object, keys, surface)) {}

Map Sequence::map(std::uint64_t sequence, double noise_um) {
  truth_.indentation_mm(sequence, mm_);
  std::normal_distribution<double> normal;
  std::vector<std::int16_t> all;
  all.reserve(std::size_t{kSide} * kSide);
  Map map;
  map.grid.x = kSide;
  map.grid.y = kSide;
  int right = -1;
  int bottom = -1;
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const auto at = static_cast<std::size_t>((row + kRow) * 800 + column + kColumn);
      all.push_back(static_cast<std::int16_t>(
          std::lround(1000 * static_cast<double>(mm_[at]) + noise_um * normal(random_))));
      if (all.back() <= kPressedUm) continue;
      map.grid.x = std::min(map.grid.x, std::max(0, column - kMargin));
      map.grid.y = std::min(map.grid.y, std::max(0, row - kMargin));
      right = std::max(right, std::min(kSide - 1, column + kMargin));
      bottom = std::max(bottom, std::min(kSide - 1, row + kMargin));
    }
  }
  if (right < 0) return {};
  map.grid.width = right - map.grid.x + 1;
  map.grid.height = bottom - map.grid.y + 1;
  map.grid.full_width = map.grid.full_height = kSide;
  map.grid.mm_per_px = kMmPerPx;
  for (int row = map.grid.y; row <= bottom; ++row) {
    const auto* from = all.data() + std::ptrdiff_t{row} * kSide + map.grid.x;
    map.values.insert(map.values.end(), from, from + map.grid.width);
  }
  map.grid.values = map.values;
  return map;
}

Motion Sequence::place(std::uint64_t sequence) const {
  const hal::sim::Pose pose = truth_.pose(0, sequence).value();
  const Eigen::Vector3d turn =
      Eigen::Vector3d(pose.turn_deg[0], pose.turn_deg[1], pose.turn_deg[2]) * M_PI / 180;
  Motion place;
  if (turn.norm() > 0) {
    place.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  }
  place.translation = Eigen::Vector3d(pose.x_mm, pose.y_mm, pose.z_mm) * 1e-3;
  return place;
}

Motion Sequence::motion(std::uint64_t sequence) const {
  const Motion from = place(0);
  const Motion to = place(sequence);
  const Eigen::Matrix3d rotation = to.rotation * from.rotation.transpose();
  return {rotation, to.translation - rotation * from.translation};
}

}  // namespace dtact::pose
