#pragma once

#include "clients/calibrate/fit/press_gain.hpp"
#include "daemon/recon/list.hpp"

namespace dtact::calibration {

/// What one press's own list needs of a layer that was fitted to the press.
struct LayerList {
  const recon::DepthList* list = nullptr;
  /// The layer's grey levels for one of the press's own list: of the two one may take darkening for
  /// a share of the light and the other not.
  double levels_per_level = 1;

  [[nodiscard]] double read_mm(double level) const;
};

/// The shape of one list at the zero of another: `list`, which its own press shows (fit_list()) but
/// for its zero, moved so that over the sure part of that press it reads in the mean what the layer
/// reads. From the sure part's edge down to no darkening it hands over to the layer's list, which
/// is 0 there, and is that on the bulge. It covers what `list` covers, and rises throughout.
struct TiedList {
  recon::DepthList list;
  double moved_mm = 0;
};
[[nodiscard]] TiedList tie(const recon::DepthList& list, const LayerList& layer,
                           const LevelledPress& press);

/// Mean darkening of the sure part of a press's contact, grey levels.
[[nodiscard]] double mean_level(const LevelledPress& press);

}  // namespace dtact::calibration
