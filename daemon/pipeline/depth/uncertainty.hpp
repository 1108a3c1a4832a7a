#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "daemon/recon/depth_sums.hpp"

namespace dtact::pipeline {

/// How far away a pixel's neighbours lie for bend_um(), in pixels of `mm_per_px` millimetres.
[[nodiscard]] int bend_reach(double mm_per_px) noexcept;

/// How sharply a depth map bends where something presses: the mean over the pressed pixels of
/// |¼ of the four neighbours − the pixel| · 2, neighbours kBendMm away, in micrometres. `sums`: of
/// the map, with bend_reach(mm_per_px). 0 where nothing presses deeper than its bend_from_um.
[[nodiscard]] double bend_um(const recon::DepthSums& sums, double mm_per_px) noexcept;

inline constexpr double kBendMm = 0.166;

/// Factor on bend and error of a contact's remaining pixels when `beyond` of its pixels are deeper
/// than the calibration and therefore untrusted, and `made` remain. Those are the rim, and next to
/// an untrusted pixel no bend is seen. Returns the square root of all over the remaining pixels.
/// With objects 1.3 to 2.1 mm deep in gels calibrated to 1.1 to 1.5 mm, 10 to 83 % untrusted, the
/// true error was 0.5 to 1.0 of the stated uncertainty, and up to 2.4 without the factor
/// (tests/accuracy/whole).
[[nodiscard]] double rim_factor(std::int64_t made, std::int64_t beyond) noexcept;

/// Uncertainty of a LUT whose calibration, an old one, does not state it, micrometres. These LUTs
/// had this error under a ball of 5 mm after one press or thirty of a ball of 4 mm
/// (tests/accuracy/table/table.md, against the true indentation, the mean over six lights: ours
/// from one press 50, the published ones 98 and 118, treated as one method here).
inline constexpr double kDefaultLutUncertaintyUm = 50;
inline constexpr double kDefaultPublishedUncertaintyUm = 118;
/// Added, in squares, while a reference scaled to another light is in use: its error was 0.02 to
/// 0.03 mm under a ball pressed 1 mm (simulated sensor).
inline constexpr double kStaleReferenceUm = 30;

/// Mean absolute error to expect inside the contact, micrometres: what the LUT is uncertain by
/// (`lut_um`) and what the gel's blur hides of edges and texture, added in squares. The blur is
/// kBlurPerBend × bend: over 15 kinds of objects in the simulator (config/scenes/all_objects.toml,
/// pressed 0.2 to 1.2 mm, a LUT taken for 20 um) the true error was 1.0 × the sum at the median
/// and at most 1.6 × in 95 % of frames. Deep narrow texture is worst (2.3 ×), for what the gel
/// has blurred away leaves no bend to be seen, and other gels blur otherwise. How honest the sum
/// is on scenes that had no part in it says tests/accuracy/chart/honesty_test.cpp.
[[nodiscard]] double uncertainty_um(double lut_um, double bend_um) noexcept;
inline constexpr double kBlurPerBend = 7.0;

/// The same were the map at 1/decimation (1, 2 or 4) of the calibration's resolution and then read
/// bilinearly: coarse pixels cut edges once more. In 95 % of the same frames that cost at most
/// 0.085 × bend at half and 0.31 × bend at quarter resolution. `steps` of sharpening give a part of
/// the blur back: see plain_bend_um(). `bend_um`: that of a plain map.
[[nodiscard]] double uncertainty_at_um(double lut_um, double bend_um, int decimation,
                                       int steps = 0) noexcept;

/// The bend of a plain map of what bends by `bend_um` in one that was sharpened so often.
[[nodiscard]] double plain_bend_um(double bend_um, int steps) noexcept;

/// Chooses the first rung of a ladder, the cheapest, whose expected error stays within a bound,
/// from one frame for the next: a more accurate one at once, a cheaper one only after kPatience
/// frames that would all have been well inside (kMargin of the bound). Where none is inside, the
/// one that is expected to be least wrong, and of several such the last.
class ResolutionChooser {
 public:
  explicit ResolutionChooser(double max_error_um) noexcept : max_error_um_(max_error_um) {}

  /// `expected_um`: of the frame just done, on each rung. Returns the rung for the next.
  std::size_t next(std::span<const double> expected_um) noexcept;

  static constexpr int kPatience = 15;
  static constexpr double kMargin = 0.9;

 private:
  double max_error_um_;
  std::size_t index_ = 0;
  int patient_ = 0;
};

}  // namespace dtact::pipeline
