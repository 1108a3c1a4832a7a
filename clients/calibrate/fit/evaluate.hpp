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

/// Error of a calibration on a ball of unknown depth, compared with a sphere about the contact's
/// centre that is zero at the contact's edge.
struct Evaluation {
  Contact contact;
  double drift_levels = 0;  ///< Subtracted from the darkening; see far_field_drift().
  double offset_mm = 0;     ///< Depth minus sphere, the median over the contact.
  double mae_mm = 0;        ///< Mean absolute error without the offset.
  double median_mm = 0;     ///< Its median.
  double within_mm = 0;     ///< What 95 % of the pixels stay within.
  double raw_mae_mm = 0;    ///< Mean absolute error with it.
  /// The press's own gain and the errors that chose it. It is removed in the two below only.
  /// Both are empty for the published method.
  ChosenAsymmetry press_asymmetry;
  /// The LUT is fitted to one half of the disc and tested on the other (without its offset). The
  /// ball's middle and the press's gain are those of the whole disc. Mean and worst of eight
  /// halves.
  std::optional<double> half_mae_mm;
  std::optional<double> half_worst_mm;
  /// All of it, including the gain's order, from every other sector of 45 degrees, tested on the
  /// rest (without its offset): mean of both ways, and of the sectors turned by half of one.
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

/// Doubts about a calibration, each a sentence with what to check; empty: none.
///
/// A LUT is made to fit its press, so it fits with a wrong scale or radius, too. The sphere itself,
/// set to zero at the contact's edge, and the known range of the family reveal them:
///
/// - Where the sphere is (Evaluation::offset_mm): LUT minus sphere, the median over the contact.
///   +0.03 to +0.06 mm on sensor_a, -0.11 to -0.06 on sensor_b, -0.03 to +0.18 in the simulator
///   (gels of 1 to 3 mm, balls of 3 to 6 mm, presses of 0.35 mm to half of the ball's radius).
///   kMaxOffsetMm is 0.22. On sensor_a a scale that is 5 % too large makes 0.24 to 0.27, 8 % 0.40
///   to 0.43, 15 % 0.75, a radius of 3.5 mm for 4 makes 0.61. The light that changed on one side by
///   a fifth of the darkening makes 0.35.
/// - Its shape (Evaluation::mae_mm): the mean distance from the offset, as a share of how deep the
///   sphere is. At most 0.01 on sensor_a and in the simulator, 0.06 on sensor_b, whose ring is
///   asymmetric. kMaxShape is 0.09. With half of the contact in the dark it is 0.10 to 0.22.
/// - The share of the contact that is too dark to be seen: none, or up to a quarter in a press like
///   that.
/// - Evenness of its light: darkening is a share of the light, but a LUT of one press uses grey
///   levels. Refused is a press of which a tenth, with its ring, has less than half the light; on
///   sensor_a and sensor_b none is, nor with corners at a quarter of the light.
/// - The LUT's slope: real sensors have 31 to 64 micrometres a grey level, simulated gels of 1 to
///   3 mm 15 to 65. Refused are slopes outside 12 to 120: a scale or a radius with a misplaced
///   decimal point.
///
/// Undetectable: scale and radius of a shallow press, of which the image shows only their
/// quotient r² / R (on a press of 1.3 mm of a 4 mm ball 15 % of the scale move the offset by 0.04
/// mm), and a scale that is too small.
[[nodiscard]] std::vector<std::string> doubts_about(const recon::DepthLut& lut);
/// `press` is the evaluation of the press with that calibration.
[[nodiscard]] std::vector<std::string> doubts_about(const Evaluation& press);

/// Doubts about the LUT and the press from which it was made.
[[nodiscard]] std::vector<std::string> doubts_about(const Calibration& made,
                                                    const BallPress& press);
/// Doubts about the LUT and every press that shows a contact, by name.
[[nodiscard]] std::vector<std::string> doubts_about(const Calibration& made,
                                                    const BallPresses& set);

/// A sentence, which is not a doubt, when at least half a per cent of the map has less than
/// half of the light at the presses' contacts, and the calibration counts darkening the same
/// at every position without a board that confirms it; else empty. Where darkening is a share of
/// the light, as in the simulator, depth reads too shallow there, and presses in the middle of an
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
