#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "clients/calibrate/fit/press_asymmetry.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// A ball press with its darkening and contact.
struct SettledPress {
  Contact contact;
  double drift_levels = 0;
  DarkeningMap map;                         ///< Smoothed, without the drift.
  std::vector<std::uint16_t> reference_q8;  ///< The reference moved by the drift.
};

/// The map at the places where its points lie, instead of where they appear: `depth_mm(level)` is
/// how deep a point of that darkening is pressed in. Interpolated between the pixels.
[[nodiscard]] DarkeningMap in_true_places(const DarkeningMap& map, const recon::Viewpoint& view,
                                          const std::function<double(double level)>& depth_mm);

/// Finds the contact, in a map of true places where the model knows the camera's place. Where the
/// far field shows that the light drifted between reference and frames, moves the reference by the
/// drift and finds it again. Throws like find_contact().
[[nodiscard]] SettledPress settle(const recon::Model& model,
                                  std::span<const std::uint16_t> reference_q8,
                                  std::span<const image::Grey8> frames, double ball_radius_mm);

/// settle() of a press to calibrate with. Throws std::runtime_error with the fix also where more
/// than a hundredth of the contact is white in the reference or black in the frames: grey levels
/// that were cut off there make the LUT too shallow.
[[nodiscard]] SettledPress settle_unclipped(const recon::Model& model,
                                            const image::Grey16& reference_q8,
                                            const std::vector<image::Grey8>& frames,
                                            double ball_radius_mm);

/// Whether two contacts in one map are the same: their centres are less than half of the first's
/// radius apart. Under another gain a dark part may darken by more than the ball.
[[nodiscard]] bool same_place(const Contact& a, const Contact& b, double mm_per_px) noexcept;

/// Position of the depth map in the frame.
struct Crop {
  int col = 0;
  int row = 0;
  int width = 0;
  int height = 0;
};

/// Input of a depth calibration.
struct BallPress {
  image::Grey16 reference_q8;        ///< Reference image, Q8 luma, the mean of many frames.
  std::vector<image::Grey8> frames;  ///< The ball pressed in and at rest.
  double ball_radius_mm = 0;
  double mm_per_px = 0;             ///< The depth map's scale.
  std::optional<recon::Lens> lens;  ///< None: the frame is not rectified.
  /// Part of the frame or, with a lens, of the rectified image; none: the whole frame.
  std::optional<Crop> crop;
  CameraView view;  ///< Of the lens; unknown: depth is placed as it is seen.
  /// Places in millimetres of the lens's surface; without a lens from the map's centre. The
  /// published method has none.
  recon::FlatFieldGain gain = {};
  recon::Method method = recon::Method::lut;
  /// Whether the press may decide, where `gain` does not, if darkening is a share of the light.
  bool may_share_light = false;
  /// Measured depth of the ball's lowest point, if any. The published method does not use it.
  std::optional<double> depth_mm = {};
};

/// The choices made for one press, with their reasons.
struct PressChoices {
  ChosenAsymmetry press_asymmetry;
  /// Whether the calibration treats darkening as a share of the light, and the size of the press's
  /// own plane, per mm, without and with that.
  struct Light {
    bool shared = false;
    double plain_per_mm = 0;
    double shared_per_mm = 0;
  };
  std::optional<Light> light;  ///< None: not asked, or undecidable.
  /// Why the press is lost as a share of the light, though it has a contact; empty: it is not.
  std::string share_refused;
  std::optional<double> depth_mm;  ///< BallPress::depth_mm.

  /// A description of a sentence or two.
  [[nodiscard]] std::string describe() const;
};

/// Throws std::invalid_argument, saying which and the range, unless the ball's radius is 0.1 to
/// 100 mm and the scale 0.001 to 1 mm a pixel.
void check_sizes(double ball_radius_mm, double mm_per_px);

/// A calibration without a LUT: frame, crop (none: the whole frame), scale, lens,
/// smoothing, reference, camera's place. A height that is known in grey levels only is assumed
/// until a LUT says it (view_with()). Throws std::invalid_argument when the crop leaves the frame.
[[nodiscard]] Calibration empty_calibration(const image::Grey16& reference_q8,
                                            const std::optional<Crop>& crop, double mm_per_px,
                                            const std::optional<recon::Lens>& lens,
                                            const CameraView& view = {});

/// The view with the height that a LUT makes of its grey levels: the board's where it is believed
/// (kMinPerMm to kMaxPerMm), else the assumed one. One that has a height stays.
[[nodiscard]] CameraView view_with(const CameraView& view, const recon::DepthLut& lut);
/// "camera: 31 ± 1 mm above the surface (board of pins), its axis meets it ...".
[[nodiscard]] std::string describe(const CameraView& view);

/// Whether a gain, of positions from the middle of a map of this size, stays between half and twice
/// of its middle at the map's corners. It is fitted where presses or pins are and used everywhere:
/// a gain that halves or doubles at a corner is extrapolated there.
[[nodiscard]] bool reaches_corners(const recon::FlatFieldGain& gain, double width_mm,
                                   double height_mm) noexcept;

/// A lens file's gain, whose positions are millimetres of the lens's surface, converted to
/// positions from the middle of the calibration's map, as in recon::Model. Without a lens both are
/// the same. Leaves out a polynomial that is extrapolated too far (reaches_corners()). Throws
/// std::invalid_argument when the gain is not above zero there.
[[nodiscard]] recon::FlatFieldGain gain_on_map(const recon::FlatFieldGain& gain,
                                               const Calibration& calibration);

/// A sentence on a polynomial that gain_on_map() leaves out; empty: it leaves out none.
[[nodiscard]] std::string gain_left_out(const recon::FlatFieldGain& gain,
                                        const Calibration& calibration);

/// The depth map's part of the reference, the nearest pixels, to whole grey levels.
[[nodiscard]] image::Grey8 rectified_reference(const recon::RectifyTable& table,
                                               const image::Grey16& q8);
/// The same for the mean of the frames.
[[nodiscard]] image::Grey8 rectified_mean(const recon::RectifyTable& table,
                                          const std::vector<image::Grey8>& frames);

/// The smoothing's standard deviation, millimetres. Light scatters sideways by about 0.3 mm in the
/// gel, so that smoothing by 0.1 mm widens an edge by 5 % and reduces a frame's noise of one grey
/// level (32 µm) to 0.14 (5 µm) at 0.05 mm a pixel. On the real ball presses the error of the half
/// that was not fitted falls by less than 1 µm a pixel with more smoothing.
inline constexpr double kSmoothingMm = 0.1;

/// Builds a calibration from images only, with its uncertainty (uncertainty_of_zero()). The caller
/// fills `origin`. The LUT is fitted to the press without its own gain
/// (choose_asymmetry()), and zeroed by its measured depth where known; `choices` receives the
/// choices.
///
/// Darkening is treated as a share of the light when all three hold: the press's own plane exceeds
/// 0.4 % a millimetre, the share at least halves it, and left-out sectors are predicted as well.
/// Light that falls to one side and a gel that is thicker there look the same in one press, but the
/// light shows in the reference, too, and is right far from the press as well. Under the share a
/// dark part of the map, whose few grey levels are a large share, may hide the press; then grey
/// levels are used.
///
/// Throws std::runtime_error with the fault of the images and the fix,
/// std::invalid_argument when sizes or numbers are out of range.
[[nodiscard]] Calibration build(const BallPress& press, PressChoices* choices = nullptr);

}  // namespace dtact::calibration
