#pragma once

#include <stdexcept>
#include <vector>

#include "clients/calibrate/fit/darkening_map.hpp"

namespace dtact::calibration {

/// A ball's contact.
struct Contact {
  double col = 0;             ///< Centre, pixels of the depth map.
  double row = 0;             ///< Centre, pixels of the depth map.
  double radius_mm = 0;       ///< Contact radius, at most 0.85 of the ball's.
  double ball_radius_mm = 0;  ///< The ball's radius.
  double peak_levels = 0;     ///< Greatest darkening, grey levels.
};

/// Mean darkening over rings about a point.
struct RadialProfile {
  double step_mm = 0;          ///< Width of a ring; ring i spans i·step to (i + 1)·step.
  std::vector<double> levels;  ///< Mean of each ring; NaN where it has no pixel.
  std::vector<double> shown;   ///< Part of each ring's area that lies in the map, 0 … about 1.

  /// Interpolated between the rings' middles, held at both ends.
  [[nodiscard]] double at(double radius_mm) const;
};

/// The bright ring ends at about this many ball radii from the contact's centre: at 8 mm on real
/// images of a 4 mm ball.
inline constexpr double kFarField = 2.25;

/// Height of a ball's surface above its lowest point `r` millimetres beside it.
[[nodiscard]] double sag_mm(double ball_radius_mm, double r) noexcept;

/// Distance of a pixel from the contact's centre, millimetres.
[[nodiscard]] double distance_mm(const DarkeningMap& map, const Contact& contact, int x, int y);

[[nodiscard]] RadialProfile radial_profile(const DarkeningMap& map, const Contact& contact,
                                           double reach_mm);

/// No part is dark enough to be a contact.
class NoContact : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Finds a ball's contact. The centre is the centroid of the darkening over the connected patch
/// darker than 0.3 of the peak, weighted with the darkening; the radius is where the mean darkening
/// about it falls to 3 grey levels, at most 0.85 of the ball's radius. Further out the sphere is so
/// steep that a pixel spans 0.1 mm of depth, and a contact that wide is a wrong scale or radius
/// more often than a press of half the ball, which few gels are thick enough for: where the sphere
/// ends there, LUT and sphere disagree and doubts_about() finds it (0.29 mm with sensor_a's scale 8
/// % too large; 0.13, unnoticed, with the whole contact). Throws with the fix: NoContact without
/// contact (below 8 grey levels), std::runtime_error when the contact leaves the map.
[[nodiscard]] Contact find_contact(const DarkeningMap& map, double ball_radius_mm);

/// Darkening of the surroundings without contact since the reference, grey levels: the
/// median over tiles of the far field. 0 unless it is sure, that is: at least 0.5 levels, twice the
/// spread of the tiles, and the far field shows in at least eight tiles on both sides of the
/// contact. (The faint outskirts of the bulge are uneven and fail this; a drifted lamp passes.)
[[nodiscard]] double far_field_drift(const DarkeningMap& map, const Contact& contact);

}  // namespace dtact::calibration
