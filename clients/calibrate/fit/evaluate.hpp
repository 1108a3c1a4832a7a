#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/fit/press_asymmetry.hpp"
#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// How well a calibration reads a ball of unknown depth, compared with a sphere about the contact's
/// centre that is zero at the contact's edge.
struct Evaluation {
  Contact contact;
  double drift_levels = 0;  ///< Taken off the difference; see far_field_drift().
  double offset_mm = 0;     ///< Depth minus sphere, the median over the contact.
  double mae_mm = 0;        ///< Mean absolute error without the offset.
  double raw_mae_mm = 0;    ///< Mean absolute error with it.
  /// The press's own gain and what chose it. It is taken off in the two below and in nothing above.
  /// They are empty for the published method.
  ChosenAsymmetry press_asymmetry;
  /// LUT fitted on one half of the disc, tested on the other (its offset removed), the ball's
  /// middle and the press's gain being those of the whole disc: mean and worst of eight halves.
  std::optional<double> half_mae_mm;
  std::optional<double> half_worst_mm;
  /// All of it, the gain's order included, from every other sector of 45 degrees, tested on the
  /// rest (its offset removed): mean of both ways, the sectors also turned by half of one.
  std::optional<double> sector_mae_mm;
  std::size_t pixels = 0;     ///< In the contact.
  std::size_t untrusted = 0;  ///< Marked pixels.
  std::size_t unseen = 0;     ///< Pixels too dark or masked, independent of the LUT.
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

/// What speaks against a calibration, a sentence each that says what to check; empty: nothing.
///
/// A LUT is made to fit its press, so a wrong scale or a wrong radius fits, too; what gives it
/// away is the sphere itself, set to zero at the contact's edge, and what is known of the family:
///
/// - Where the sphere is (Evaluation::offset_mm): LUT minus sphere, the median over the contact.
///   +0.03 to +0.06 mm on sensor_a, -0.11 to -0.06 on sensor_b, -0.03 to +0.18 in the simulator
///   (gels of 1 to 3 mm, balls of 3 to 6 mm, presses of 0.35 mm to half of the ball's radius).
///   kMaxOffsetMm is 0.22. On sensor_a a scale that is 5 % too large makes 0.24 to 0.27, 8 % 0.40
///   to 0.43, 15 % 0.75, a radius of 3.5 mm for 4 makes 0.61. The light that changed on one side by
///   a fifth of the darkening makes 0.35.
/// - Its shape (Evaluation::mae_mm): the mean distance from the offset, as a share of how deep the
///   sphere is. At most 0.01 on sensor_a and in the simulator, 0.06 on sensor_b, whose ring is
///   lopsided. kMaxShape is 0.09. With half of the contact in the dark it is 0.10 to 0.22.
/// - How much of the contact is too dark to be seen: none, or up to a quarter in such a press.
/// - How evenly it is lit: darkening is a share of the light, and a LUT of one press takes it as
/// it
///   is. Refused is a press with a tenth of it and its ring under less than half of its light; on
///   sensor_a and sensor_b none is, nor with corners at a quarter of the light.
/// - The LUT's slope: real sensors have 31 to 64 micrometres a grey level, simulated gels of 1
/// to
///   3 mm 15 to 65. Refused are those beyond 12 to 120: a scale or a radius that is a decimal point
///   off.
///
/// What it cannot see: scale and radius of a shallow press, of which the image shows only their
/// quotient r² / R (on a press of 1.3 mm of a 4 mm ball 15 % of the scale move the offset by 0.04
/// mm), and a scale that is too small.
[[nodiscard]] std::vector<std::string> doubts_about(const recon::DepthLut& lut);
/// `press`: as the calibration reads it.
[[nodiscard]] std::vector<std::string> doubts_about(const Evaluation& press);

/// The LUT and the press that it was made from.
[[nodiscard]] std::vector<std::string> doubts_about(const Calibration& made,
                                                    const BallPress& press);
/// The LUT and every press that shows a contact, by name.
[[nodiscard]] std::vector<std::string> doubts_about(const Calibration& made,
                                                    const BallPresses& set);

/// Not a doubt but to be known: a sentence where half a per cent of the map and more has less than
/// half of the light that the presses' contacts have, and the calibration counts darkening the same
/// at every place without a board's having said so; else empty. Where darkening is a share of the
/// light, as it is in the simulator, depth reads too shallow there, and presses in the middle of an
/// even light do not show it.
[[nodiscard]] std::string dim_part_of(const Calibration& made, const BallPresses& set);

inline constexpr double kMaxOffsetMm = 0.22;
inline constexpr double kMaxShape = 0.09;    ///< Share of the sphere's depth.
inline constexpr double kMinShapeMm = 0.05;  ///< Error always allowed, for light presses.
inline constexpr double kMaxUnseen = 0.02;   ///< Share of the contact.
inline constexpr double kMaxDim = 0.1;       ///< Share of contact and ring.
inline constexpr double kMinSlopeUm = 12;    ///< A grey level.
inline constexpr double kMaxSlopeUm = 120;   ///< A grey level.

}  // namespace dtact::calibration
