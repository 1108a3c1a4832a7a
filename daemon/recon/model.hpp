#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "daemon/recon/depth_lut.hpp"
#include "daemon/recon/flat_field_gain.hpp"
#include "daemon/recon/force.hpp"
#include "daemon/recon/rectify.hpp"
#include "daemon/recon/surface.hpp"

namespace dtact::recon {

/// Light that is scattered sideways in the gel: a point's loss of light appears as the sum of two
/// Gaussians round it.
struct Scattering {
  double narrow_mm = 0;      ///< Standard deviation, 0.01 … 5 mm.
  double wide_mm = 0;        ///< Standard deviation, above narrow_mm, at most 20 mm.
  double narrow_weight = 0;  ///< Share of the light in the narrow one, 0 … 1; the rest is wide.

  bool operator==(const Scattering&) const = default;
};

inline constexpr double kNarrowestMm = 0.01;
inline constexpr double kWidestNarrowMm = 5;
inline constexpr double kWidestMm = 20;

/// Greatest number of Van Cittert's steps (sharpener.hpp): a third sharpens more and costs noise.
inline constexpr int kMaxSharpeningSteps = 2;

/// Levels are sharpened at 1/kSharpenedAt of the calibration's resolution in each direction, which
/// the gel's own blur leaves enough of.
inline constexpr int kSharpenedAt = 4;

/// Throws std::invalid_argument, naming the key as in calibration.toml, outside those ranges.
void check(const Scattering& scattering);

/// Depth value of an untrusted pixel. 0 is a valid depth (no contact).
inline constexpr std::int16_t kUntrusted = INT16_MIN;

enum class Method : std::uint8_t {
  /// Ours: signed difference, smoothing, per-pixel gain, monotone LUT.
  lut,
  /// The paper's single-image LUT as its authors run it: whole grey levels, LUT, two 7×7 Gaussian
  /// filters. The LUT's entries below the threshold are 0 and the threshold's own depth is already
  /// taken off the others (calibration/published.hpp); the light's gain is not applied.
  published
};

/// All that a calibration fixes. Immutable and shared between threads once made.
struct Model {
  Method method = Method::lut;
  RectifyTable rectify;  ///< Camera frame → depth map.
  /// 1, 2 or 4: frames and map have 1/frame_scale of the calibration's pixels in each direction
  /// (for_scaled_frames()).
  int frame_scale = 1;
  double mm_per_px = 0;  ///< Millimetres per pixel of the depth map.
  /// Standard deviation of the Gaussian that smooths the difference, pixels of the depth map, 0 …
  /// 10. Method::published has filters of its own and ignores it.
  double smoothing_px = 0;
  DepthLut lut;
  /// What the LUT is uncertain by: mean absolute error in micrometres at some indentations,
  /// ascending. Empty: not known.
  struct Uncertainty {
    double depth_mm = 0;
    double error_um = 0;
  };
  std::vector<Uncertainty> uncertainty;
  /// How the gel spreads light sideways, as fitted. None: not known, nothing can be sharpened.
  std::optional<Scattering> scattering;
  /// LUT for one filter only: for levels sharpened by this number of
  /// steps. Ascending, each of 1 and 2 at most once; with `scattering` and Method::lut only.
  struct Sharpened {
    int steps = 0;
    DepthLut lut;
    std::vector<Uncertainty> uncertainty;
  };
  std::vector<Sharpened> sharpened;
  FlatFieldGain gain;  ///< Of Method::lut.
  /// The reference image at calibration time, frame sized, Q8 luma (0…65280), row-major without
  /// padding: brings a differently lit image back to the calibration's light.
  std::vector<std::uint16_t> reference_q8;
  /// Depth-map sized; non-zero marks pixels that are never trusted. Empty: none.
  std::vector<std::uint8_t> untrusted;
  std::optional<ForceModel> force;  ///< None: not calibrated.
  Surface surface;  ///< The indentation is measured from it; it gives a pixel's position in space.
};

/// Throws std::invalid_argument, naming the part, where the parts do not fit each other.
void check(const Model& model);

/// The model of a map of 1/`factor` the resolution (1, 2 or 4), for slow hosts. Its pixels are
/// means over factor × factor of the model's, taken before smoothing. The
/// smoothing keeps its width in millimetres, and a pixel that covers an untrusted one is untrusted.
/// Columns and rows that fill no pixel are left out on both sides alike, so the centre stays
/// within half a pixel of `model`. Throws
/// std::invalid_argument for another factor, a map smaller than one pixel or a decimated model.
[[nodiscard]] Model decimate(const Model& model, int factor);

/// The model for a camera whose frames are decoded at 1/`scale` (1, 2 or 4) of their size, each
/// pixel the mean of scale × scale. A pixel of its map is that of decimate() with this factor, but
/// is read once: at the mean place of the pixels it stands for. Throws std::invalid_argument for
/// another scale, frames whose sides are no multiples of it, a map smaller than one pixel of the
/// result or a decimated model.
[[nodiscard]] Model for_scaled_frames(const Model& model, int scale);

}  // namespace dtact::recon
