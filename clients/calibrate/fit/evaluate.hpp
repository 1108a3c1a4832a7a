#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "clients/calibrate/fit/contact.hpp"
#include "clients/calibrate/fit/press_gain.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// How well a calibration reads a ball whose depth nobody knows: against a sphere about the
/// contact's centre that meets zero at the contact's edge.
struct Evaluation {
  Contact contact;
  double drift_levels = 0;  ///< Taken off the difference; see far_field_drift().
  double offset_mm = 0;     ///< Depth minus sphere, the median over the contact.
  double mae_mm = 0;        ///< Mean absolute error without the offset.
  double raw_mae_mm = 0;    ///< Mean absolute error with it.
  /// The press's own gain and what chose it. It is taken off in the two below and in nothing above.
  /// They are empty for the published method.
  ChosenPressGain press_gain;
  /// List fitted on one half of the disc, tested on the other (its offset removed), the ball's
  /// middle and the press's gain being those of the whole disc: mean and worst of eight halves.
  std::optional<double> half_mae_mm;
  std::optional<double> half_worst_mm;
  /// All of it, the gain's order included, from every other sector of 45 degrees, tested on the
  /// rest (its offset removed): mean of both ways, the sectors also turned by half of one.
  std::optional<double> sector_mae_mm;
  std::size_t pixels = 0;     ///< In the contact.
  std::size_t untrusted = 0;  ///< Of them, marked.
  std::size_t unseen = 0;     ///< Of them, too dark or masked, whatever the list says.
  /// Share of the contact and of the ring about it (half a radius wide) that has less than half of
  /// their median light.
  double dim = 0;
};

/// `reference_q8`: frame sized Q8 luma under the frames' light. Throws std::runtime_error when no
/// contact is found and std::invalid_argument when sizes disagree.
[[nodiscard]] Evaluation evaluate(const Calibration& calibration,
                                  std::span<const std::uint16_t> reference_q8,
                                  std::span<const image::Grey8> frames, double ball_radius_mm);

/// The same without gain, halves and sectors.
[[nodiscard]] Evaluation read_ball(const Calibration& calibration,
                                   std::span<const std::uint16_t> reference_q8,
                                   std::span<const image::Grey8> frames, double ball_radius_mm);

}  // namespace dtact::calibration
