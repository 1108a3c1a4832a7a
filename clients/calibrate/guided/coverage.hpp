#pragma once

#include <memory>
#include <string>
#include <vector>

#include "clients/calibrate/guided/console.hpp"
#include "clients/calibrate/offline/depth_build.hpp"

namespace dtact::ctl::guided {

/// Coverage of the presses so far without a gel model, which is quick to compute. The presses that
/// it lacks improve the LUT with every calibration method.
struct Coverage {
  /// Null where they determine no LUT, or one that is doubted.
  std::shared_ptr<const calibration::Calibration> made;
  calibration::PressReport report;     ///< Of `made`.
  std::string missing;                 ///< Where they do not: why, and what to press.
  std::vector<std::string> doubts;     ///< What speaks against a LUT, a sentence each.
  std::vector<CapturedPress> presses;  ///< Those that show a contact.
};

/// `empty`: the map and the reference of these images, without a LUT. `force`: a LUT is made
/// although it is doubted.
[[nodiscard]] Coverage cover(const PressImages& images, const calibration::Calibration& empty,
                             bool force);

/// Why a doubted LUT is not made: the doubts, and what takes it anyhow.
[[nodiscard]] std::string doubted(const std::vector<std::string>& doubts);

/// How deep the covered LUT reaches, millimetres.
[[nodiscard]] double covered_mm(const calibration::Calibration& made);

/// Width of the contact of a ball pressed `depth_mm` deep, millimetres.
[[nodiscard]] double contact_width_mm(double depth_mm, double ball_radius_mm);
/// How deep a ball is that makes a contact of this width; a rough figure, from the same formula.
[[nodiscard]] double depth_of_width_mm(double width_mm, double ball_radius_mm);

/// How deep to press next: first as deep as three tenths of the ball's radius (1.2 mm of a ball of
/// 4 mm), then into the middle of the widest gap between the depths there are. A press lighter than
/// kLightestMm hardly shows.
[[nodiscard]] double next_depth_mm(std::vector<double> depths_mm, double ball_radius_mm);
inline constexpr double kLightestMm = 0.3;

}  // namespace dtact::ctl::guided
