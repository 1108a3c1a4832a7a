#include "clients/calibrate/fit/model/depth_spread.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "clients/calibrate/fit/list_shape.hpp"
#include "clients/calibrate/fit/model/tied_list.hpp"

namespace dtact::calibration {
namespace {

/// Of the ball's radius: the profile goes to 2.25 (kFarField).
constexpr std::array<double, 2> kReaches = {1.5, 1.75};
/// Right, down, left, up.
constexpr std::array<std::pair<int, int>, 4> kSides = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

std::vector<PixelFilter> parts_of(const LevelledPress& press) {
  const Contact& contact = press.contact;
  std::vector<PixelFilter> parts;
  parts.reserve(kSides.size() + kReaches.size());
  for (const auto& [right, down] : kSides) {
    parts.emplace_back([&contact, right, down](int x, int y) {
      return right * (x - contact.col) + down * (y - contact.row) > 0;
    });
  }
  for (const double reach : kReaches) {
    parts.emplace_back([&press, within_mm = reach * contact.ball_radius_mm](int x, int y) {
      return distance_mm(press.map, press.contact, x, y) < within_mm;
    });
  }
  return parts;
}

}  // namespace

double depth_spread_mm(const LevelledPress& press, const MapOptics& optics, const ModelFit& fit) {
  const double level = mean_level(press);
  const auto depth_mm = [&](const PixelFilter& use) {
    const PressProfile profile = profile_of(press, optics.light_levels, optics.smoothing_mm, use);
    const ModelFit part = fit_model(std::span(&profile, 1), fit);
    return look_up_mm(lists_of(part.layer, optics, part.deepest_mm()).front(), level);
  };
  try {
    const double all_mm = depth_mm({});
    double most_mm = 0;
    for (const PixelFilter& part : parts_of(press)) {
      most_mm = std::max(most_mm, std::abs(depth_mm(part) - all_mm));
    }
    return most_mm;
  } catch (const ModelRefused&) {
    return std::numeric_limits<double>::infinity();
  }
}

}  // namespace dtact::calibration
