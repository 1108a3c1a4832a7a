#pragma once

#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "daemon/recon/list.hpp"

namespace dtact::calibration {

/// A point of a list: darkening, indentation, and how many pixels say so.
struct Knot {
  double level = 0;
  double depth_mm = 0;
  double weight = 0;
};

/// The indentation of a darkening between the origin and the knots (levels ascending, above 0), and
/// the last knot's beyond.
[[nodiscard]] double interpolate(const std::vector<Knot>& knots, double level);

/// A whole list from the knots of its pressed side, which rise.
///
/// - Above the last knot it goes on with `slope_beyond`, millimetres a grey level; two grey levels
///   of that are vouched for, so that a frame's noise is not beyond the calibration.
/// - The bulge: −c·(1 − exp(s·ΔI / c)) for ΔI < 0, with the slope s at zero. A thickening layer
///   brightens ever faster, so the list flattens; c is where the volume of the bulge equals that of
///   the dent in `profile`, a press, since the layer is incompressible.
[[nodiscard]] recon::DepthList make_list(const std::vector<Knot>& knots, double slope_at_zero,
                                         double slope_beyond, const RadialProfile& profile);

/// What a list says of a darkening, grey levels: millimetres; its ends' beyond them.
[[nodiscard]] double look_up_mm(const recon::DepthList& list, double level);

/// What lists span: the design's −40 to +110 grey levels.
inline constexpr int kListFirstLevel = -40;
inline constexpr int kListLastLevel = 110;

}  // namespace dtact::calibration
