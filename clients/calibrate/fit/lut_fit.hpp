#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "daemon/recon/depth_lut.hpp"

namespace dtact::calibration {

/// A point of a LUT: darkening, indentation, and the number of pixels.
struct Knot {
  double level = 0;
  double depth_mm = 0;
  double weight = 0;
};

/// The indentation of a darkening, interpolated between the origin and the knots (levels ascending,
/// above 0); beyond the last knot its own.
[[nodiscard]] double interpolate(const std::vector<Knot>& knots, double level);

/// Makes a whole LUT from the knots of its pressed side, which rise.
///
/// - Above the last knot it continues with `slope_beyond`, millimetres a grey level; two grey
///   levels of that count as covered, so that a frame's noise is not beyond the calibration.
/// - The bulge: −c·(1 − exp(s·ΔI / c)) for ΔI < 0, with the slope s at zero. A thickening gel
///   brightens ever faster, so the LUT flattens; at c the volume of the bulge equals that of
///   the dent in `profile`, a press, since the gel is incompressible.
[[nodiscard]] recon::DepthLut make_lut(const std::vector<Knot>& knots, double slope_at_zero,
                                       double slope_beyond, const RadialProfile& profile);

/// The LUT's indentation for a darkening in grey levels, millimetres; its ends' beyond them.
[[nodiscard]] double lut_mm(const recon::DepthLut& lut, double level);

/// Millimetres a grey level from no darkening to 20 levels, a light press of about 0.6 mm, or to
/// the end of what the LUT covers.
[[nodiscard]] double slope_mm(const recon::DepthLut& lut);

/// Range of a LUT: −40 to +110 grey levels.
inline constexpr int kLutFirstLevel = -40;
inline constexpr int kLutLastLevel = 110;

/// Pixels of the depth map that a fit may use; empty: all.
using PixelFilter = std::function<bool(int x, int y)>;

/// The sure part of a contact, as a share of its radius: beyond it the bright ring's scattered
/// light disturbs.
inline constexpr double kSureOfContact = 0.9;

/// Fit of the sure part of a press's contact: sag = depth − slope · darkening.
struct SagFit {
  double depth_mm = 0;  ///< Depth of the lowest point, with zero darkening = zero depth.
  double slope = 0;     ///< Millimetres a grey level.
};

/// Step 1 of fit_lut(). Throws like fit_lut().
[[nodiscard]] SagFit fit_sag(const DarkeningMap& map, const Contact& contact,
                             const PixelFilter& use = {});

/// Fits the LUT of one press of a ball from its image.
///
/// Inside the contact the surface is the ball: its indentation is g − sag(r) with
/// sag(r) = R − √(R² − r²) and an unmeasured depth g, so one press shows only the LUT's
/// slope. The published LUT finds g by putting zero indentation at the contact's edge, which is
/// biased: the gel's surface is still pressed there, by 0.03 … 0.2 mm depending on its thickness.
/// Without any circle it is known that a pixel without contact (no darkening) is at zero. So:
///
/// 1. In the sure part of the contact (0.9 of its radius) the sag is a straight line of the
///    darkening. Each grey level has the same weight in the fit, because shallow and deep pixels
///    matter equally for a line that is extended to zero. Its value at no darkening is g.
/// 2. Indentation g − sag over the whole contact, one mean for each half grey level, made monotone
///    (pool adjacent violators).
/// 3. Towards the contact's edge the bright ring's scattered light lowers the darkening, the more
///    the deeper the press, so one press's edge does not apply to another. From the sure
///    part's edge down to zero the fit blends into the straight line to the origin.
/// 4. make_lut() adds the range beyond and the bulge, along the line of 1.
///
/// `depth_mm` is the measured depth of the ball's lowest point, if any; then it is g.
///
/// Throws std::runtime_error when the image doesn't darken from the contact's edge to its centre.
[[nodiscard]] recon::DepthLut fit_lut(const DarkeningMap& map, const Contact& contact,
                                      const PixelFilter& use = {},
                                      std::optional<double> depth_mm = {});

}  // namespace dtact::calibration
