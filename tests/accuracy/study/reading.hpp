#pragma once

#include <span>
#include <vector>

#include "tests/accuracy/study/bench.hpp"

/// The study's measurements in its images, by its own rules. The object is at the image's
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

/// A depth map from the LUT and the measures of a flat object in it.
struct FlatReading {
  double depth_mm = 0;     ///< Median within 1 mm of the centre.
  double diameter_mm = 0;  ///< Diameter of a circle as large as the part at least half as deep.
  double side_mm = 0;      ///< Mean of that patch's width and height.
};
/// Reads a map like the published pipeline: levels smoothed (Gaussian, 7 × 7), the LUT less its
/// entry at 2 grey levels, smoothed twice more.
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
/// Reads along the greater axis of the part darker than 4 grey levels, from its centroid, averaged
/// over 0.4 mm to either side; peaks within 0.35 mm of their nominal places, trough within 0.2 mm
/// of the middle. All zero where nothing is that dark.
[[nodiscard]] Pillars read_pillars(const Darkening& image, double spacing_mm);

/// The largest patch that is darker than a threshold, without specks and small holes (opened by 5
/// pixels, closed by 11): radius of a circle of equal area, and the mean there, grey levels. Zero
/// without a patch.
struct Patch {
  double radius_mm = 0;
  double mean = 0;
};
[[nodiscard]] Patch patch_above(const Darkening& image, int levels);

}  // namespace dtact::study
