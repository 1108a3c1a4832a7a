#pragma once

#include <span>
#include <vector>

#include "tests/accuracy/study/bench.hpp"

/// What the study reads in its images, by the rules that it states. The object is at the image's
/// centre.
namespace dtact::study {

/// A press of a ball to a known depth.
struct KnownPress {
  const Darkening* image = nullptr;
  double depth_mm = 0;
};

/// The published LUT as the study makes it: the mean height above the edge of a geometric contact
/// circle of radius √(2Rd − d²), for each whole grey level, over all presses.
struct StudyLut {
  std::vector<double> depth_mm;  ///< By grey level.
  int deepest_level = 0;         ///< 99th percentile within the contact of the darkest press.
};
/// Throws std::runtime_error when the presses show fewer than four grey levels.
[[nodiscard]] StudyLut make_lut(std::span<const KnownPress> presses, double ball_radius_mm);

/// A depth map read by the LUT and what a flat object's is judged by.
struct FlatReading {
  double depth_mm = 0;     ///< Median within 1 mm of the centre.
  double diameter_mm = 0;  ///< Radius of a circle as large as what is at least half as deep.
  double side_mm = 0;      ///< Mean of that patch's width and height.
};
/// The published reading: levels smoothed (Gaussian, 7 × 7), the LUT less its entry at 2 grey
/// levels, smoothed twice more.
[[nodiscard]] FlatReading read_flat(const Darkening& image, const StudyLut& lut);

/// Two pillars, `spacing_mm` between their centres.
struct Pillars {
  double dip = 0;       ///< 1 − trough / weaker peak.
  double peak = 0;      ///< The weaker one, grey levels.
  double symmetry = 0;  ///< Weaker over stronger.
  double dip_sd = 0;    ///< From the profile's own noise.
  /// Peak ≥ 2.5 grey levels, dip ≥ 0.265 (Rayleigh) and ≥ 3 of its standard deviations.
  [[nodiscard]] bool resolved() const noexcept;
};
/// Along the greater axis of what is darker than 4 grey levels, from its centroid, averaged over
/// 0.4 mm to either side; peaks within 0.35 mm of where they should be, trough within 0.2 mm of the
/// middle. All zero where nothing is that dark.
[[nodiscard]] Pillars read_pillars(const Darkening& image, double spacing_mm);

/// The largest patch that is darker than a threshold, without specks and small holes (opened by 5
/// pixels, closed by 11): radius of a circle as large, and the mean there, grey levels. Zero where
/// there is none.
struct Patch {
  double radius_mm = 0;
  double mean = 0;
};
[[nodiscard]] Patch patch_above(const Darkening& image, int levels);

}  // namespace dtact::study
