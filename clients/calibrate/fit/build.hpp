#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "clients/calibrate/fit/press_asymmetry.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// A ball press and what was read off it.
struct SettledPress {
  Contact contact;
  double drift_levels = 0;
  DarkeningMap map;                         ///< Smoothed, drift taken off.
  std::vector<std::uint16_t> reference_q8;  ///< The reference moved by the drift.
};

/// Finds the contact and, where the far field is sure that the light drifted between reference and
/// frames, moves the reference by the drift and looks again. Throws as find_contact().
[[nodiscard]] SettledPress settle(const recon::Model& model,
                                  std::span<const std::uint16_t> reference_q8,
                                  std::span<const image::Grey8> frames, double ball_radius_mm);

/// Whether two contacts in one map are the same one: their centres less than half of the first's
/// radius apart. Under another gain something dark may darken by more than the ball.
[[nodiscard]] bool same_place(const Contact& a, const Contact& b, double mm_per_px) noexcept;

/// The depth map's place in the frame.
struct Crop {
  int col = 0;
  int row = 0;
  int width = 0;
  int height = 0;
};

/// What a depth calibration is built from.
struct BallPress {
  image::Grey16 reference_q8;        ///< Untouched, Q8 luma, the mean of many frames.
  std::vector<image::Grey8> frames;  ///< The ball pressed in and at rest.
  double ball_radius_mm = 0;
  double mm_per_px = 0;             ///< The depth map's scale.
  std::optional<recon::Lens> lens;  ///< None: the frame as it is.
  /// Part of the frame or, with a lens, of the rectified image; none: the whole frame.
  std::optional<Crop> crop;
  /// Places in millimetres of the lens's surface; without a lens from the map's centre. The
  /// published method has none.
  recon::FlatFieldGain gain = {};
  recon::Method method = recon::Method::lut;
  /// Where `gain` says nothing, the press may: whether darkening is a share of the light.
  bool may_share_light = false;
  /// Measured depth of the ball's lowest point, if any. The published method does not use it.
  std::optional<double> depth_mm = {};
};

/// What one press chose, and why.
struct PressChoices {
  ChosenAsymmetry press_asymmetry;
  /// Whether the calibration takes darkening as a share of the light, and by how much the press
  /// leans (the size of its own plane, per mm) without and with.
  struct Light {
    bool shared = false;
    double plain_per_mm = 0;
    double shared_per_mm = 0;
  };
  std::optional<Light> light;  ///< None: not asked, or not to be told.
  /// Why the press, which is seen as it is, cannot be read as a share of the light; empty: it can.
  std::string share_refused;
  std::optional<double> depth_mm;  ///< BallPress::depth_mm.

  /// In a sentence or two.
  [[nodiscard]] std::string describe() const;
};

/// Throws std::invalid_argument, saying which and the range, unless the ball's radius is above 0.1
/// and below 100 mm and the scale 0.001 to 1 mm a pixel.
void check_sizes(double ball_radius_mm, double mm_per_px);

/// A calibration without a LUT: frame, crop (none: all that the frame shows), scale, lens,
/// smoothing, reference. Throws std::invalid_argument when the crop leaves the frame.
[[nodiscard]] Calibration empty_calibration(const image::Grey16& reference_q8,
                                            const std::optional<Crop>& crop, double mm_per_px,
                                            const std::optional<recon::Lens>& lens);

/// Whether a gain, of places from the middle of a map of this size, stays between half and twice
/// of its middle at the map's corners. It is fitted where presses or pins are and used everywhere:
/// what halves or doubles at a corner was not seen but extended there.
[[nodiscard]] bool reaches_corners(const recon::FlatFieldGain& gain, double width_mm,
                                   double height_mm) noexcept;

/// A lens file's gain, whose places are millimetres of the lens's surface, with places from the
/// middle of the calibration's map, as recon::Model has it. Without a lens they are that already.
/// Without its polynomial where that was extended too far (reaches_corners()).
/// Throws std::invalid_argument when the gain is not above zero there.
[[nodiscard]] recon::FlatFieldGain gain_on_map(const recon::FlatFieldGain& gain,
                                               const Calibration& calibration);

/// A sentence on a polynomial that gain_on_map() leaves out; empty: it does not.
[[nodiscard]] std::string gain_left_out(const recon::FlatFieldGain& gain,
                                        const Calibration& calibration);

/// The depth map's part of the reference, the nearest pixels, to whole grey levels.
[[nodiscard]] image::Grey8 rectified_reference(const recon::RectifyTable& table,
                                               const image::Grey16& q8);
/// The same of the mean of the frames.
[[nodiscard]] image::Grey8 rectified_mean(const recon::RectifyTable& table,
                                          const std::vector<image::Grey8>& frames);

/// The smoothing's standard deviation, millimetres. Light scatters sideways by about 0.3 mm in the
/// gel, so that smoothing by 0.1 mm widens an edge by 5 % and takes a frame's noise of one grey
/// level (32 µm) to 0.14 (5 µm) at 0.05 mm a pixel. On the real ball presses the error of the half
/// that was not fitted falls by less than 1 µm a pixel from there on.
inline constexpr double kSmoothingMm = 0.1;

/// Builds a calibration from images alone, with its uncertainty (uncertainty_of_zero()). `origin`
/// is left for the caller to fill. The LUT is fitted to the press without its own gain
/// (choose_asymmetry()), and zeroed by its measured depth where there is one; `choices` says
/// what was chosen.
///
/// The share of the light is taken where the press leans by more than 0.4 % a millimetre, half of
/// that at most under the share, and sectors that are left out lose nothing by it. A light that
/// falls to one side and a gel that is thicker there look alike in one press, but the light shows
/// in the reference, too, and is right far from the press as well. A press that is lost under the
/// share, to a dark part of the map whose few grey levels are a great share, is read as it is.
///
/// Throws std::runtime_error saying what is wrong with the images and what to do,
/// std::invalid_argument when sizes or numbers cannot be.
[[nodiscard]] Calibration build(const BallPress& press, PressChoices* choices = nullptr);

}  // namespace dtact::calibration
