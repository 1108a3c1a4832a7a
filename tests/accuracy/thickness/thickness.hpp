#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "hal/sim/scene.hpp"

namespace dtact::thickness {

/// Gel thicknesses in the paper, millimetres.
inline constexpr std::array<double, 5> kThicknesses = {1.0, 1.5, 2.0, 2.5, 3.0};

/// Criterion for a groove. A plate of 6 mm with square ridges half a pitch wide is pressed in until
/// the ridges are `depth` deep; the grooves are 0.4 mm deep or as deep as the press. Contrast is
/// the difference between the depth map's mean over the ridges' middles and that over the grooves',
/// across the middle of the plate, as a share of the same difference in the true surface. A pitch
/// is resolved while that share is at least a half and the difference is at least 0.02 mm, which is
/// above noise and LUT.
struct Groove {
  double pitch_mm = 0;
  double true_mm = 0;   ///< Ridge minus groove, in the gel's surface.
  double shown_mm = 0;  ///< The same in the depth map.
  [[nodiscard]] bool resolved() const noexcept {
    return shown_mm >= 0.02 && shown_mm >= 0.5 * true_mm;
  }
};

/// Criterion for a press of a ball of 5 mm radius: measured while the mean error in contact is at
/// most a tenth of its depth and under 5 % of its pixels are untrusted.
struct Press {
  double depth_mm = 0;
  double error_mm = 0;
  double untrusted = 0;  ///< Share of the contact.
  [[nodiscard]] bool measured() const noexcept {
    return untrusted < 0.05 && error_mm <= 0.1 * depth_mm;
  }
};

struct Result {
  double thickness_mm = 0;
  std::vector<Groove> grooves;  ///< From coarse to fine.
  std::vector<Press> presses;   ///< From shallow to deep.
  /// The finest pitch that is resolved with all coarser ones.
  [[nodiscard]] std::optional<double> finest_mm() const;
  /// The deepest press that is measured.
  [[nodiscard]] std::optional<double> deepest_mm() const;
};

/// The simulated sensor with a gel of another thickness, no contact. The fitted optics are for 2
/// mm: the width of the scattering is scaled with the thickness, and the share of light that a
/// press blocks with its share of the thickness. Neither was measured on a real gel of another
/// thickness.
[[nodiscard]] hal::sim::Scene sensor_of(double thickness_mm);

/// Calibrates the simulated sensor with that gel from one press of a 4 mm ball, 0.85 of the
/// thickness deep, and measures.
[[nodiscard]] Result measure(double thickness_mm);

[[nodiscard]] std::string to_csv(const std::vector<Result>& results);

}  // namespace dtact::thickness
