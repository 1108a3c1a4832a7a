#include "clients/calibrate/fit/model/tied_list.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "clients/calibrate/fit/list_fit.hpp"
#include "clients/calibrate/fit/list_shape.hpp"

namespace dtact::calibration {
namespace {

double sure_mm(const LevelledPress& press) { return kSureOfContact * press.contact.radius_mm; }

/// Mean of `value(level)` over the sure part of a press's contact.
template <typename Value>
double mean_of_sure(const LevelledPress& press, const Value& value) {
  double sum = 0;
  double pixels = 0;
  for (int y = 0; y < press.map.height; ++y) {
    for (int x = 0; x < press.map.width; ++x) {
      const double level = press.map.at(x, y);
      const bool sure = distance_mm(press.map, press.contact, x, y) < sure_mm(press);
      if (!sure || std::isnan(level)) continue;
      sum += value(level);
      pixels += 1;
    }
  }
  return sum / pixels;
}

}  // namespace

double LayerList::read_mm(double level) const {
  return look_up_mm(*list, levels_per_level * level);
}

double mean_level(const LevelledPress& press) {
  return mean_of_sure(press, [](double level) { return level; });
}

TiedList tie(const recon::DepthList& list, const LayerList& layer, const LevelledPress& press) {
  TiedList tied{list, mean_of_sure(press, [&](double level) {
                  return layer.read_mm(level) - look_up_mm(list, level);
                })};
  const RadialProfile profile = radial_profile(press.map, press.contact, 2 * sure_mm(press));
  const double sure_level = std::max(1.0, profile.at(sure_mm(press)));
  const double last_level = static_cast<double>(list.covered_to_q6) / recon::kEntriesPerLevel;
  const auto apart_mm = [&](double level) {
    return look_up_mm(list, level) + tied.moved_mm - layer.read_mm(level);
  };
  double deepest_mm = -INFINITY;
  for (std::size_t i = 0; i < list.um.size(); ++i) {
    const double level = static_cast<double>(list.first_q6 + static_cast<int>(i)) /
                         static_cast<double>(recon::kEntriesPerLevel);
    const double share = std::clamp(level / sure_level, 0.0, 1.0);
    const double depth_mm =
        layer.read_mm(level) + share * apart_mm(std::clamp(level, sure_level, last_level));
    deepest_mm = std::max(deepest_mm, depth_mm);
    tied.list.um[i] = static_cast<std::int16_t>(std::lround(1000 * deepest_mm));
  }
  return tied;
}

}  // namespace dtact::calibration
