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
  /// Null where they determine no LUT, or a doubtful one.
  std::shared_ptr<const calibration::Calibration> made;
  calibration::PressReport report;     ///< Report of `made`.
  std::string missing;                 ///< Otherwise the reason, and what to press.
  std::vector<std::string> doubts;     ///< Doubts about a LUT, a sentence each.
  std::vector<CapturedPress> presses;  ///< Presses that show a contact.
};

/// `empty` has the map and the reference of these images, without a LUT. `force`: makes a LUT
/// in spite of doubts.
[[nodiscard]] Coverage cover(const PressImages& images, const calibration::Calibration& empty,
                             bool force);

/// Message when a doubtful LUT is not made: the doubts, and how to force it.
[[nodiscard]] std::string doubted(const std::vector<std::string>& doubts);

/// Depth that the LUT covers, millimetres.
[[nodiscard]] double covered_mm(const calibration::Calibration& made);

/// Width of the contact of a ball pressed `depth_mm` deep, millimetres.
[[nodiscard]] double contact_width_mm(double depth_mm, double ball_radius_mm);
/// Depth of a ball with a contact of this width; a rough figure, from the same formula.
[[nodiscard]] double depth_of_width_mm(double width_mm, double ball_radius_mm);

/// Depth of the next press: first three tenths of the ball's radius (1.2 mm with a ball of
/// 4 mm), then the middle of the widest gap between the present depths. A press lighter than
/// kLightestMm hardly shows.
[[nodiscard]] double next_depth_mm(std::vector<double> depths_mm, double ball_radius_mm);
inline constexpr double kLightestMm = 0.3;

}  // namespace dtact::ctl::guided
