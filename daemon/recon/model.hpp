#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "daemon/recon/force.hpp"
#include "daemon/recon/list.hpp"
#include "daemon/recon/rectify.hpp"
#include "daemon/recon/scattering.hpp"
#include "daemon/recon/spatial_gain.hpp"
#include "daemon/recon/surface.hpp"

namespace dtact::recon {

/// Depth value of a pixel that must not be believed. 0 is a valid depth (untouched).
inline constexpr std::int16_t kUntrusted = INT16_MIN;

enum class Method : std::uint8_t {
  /// Ours: signed difference, smoothing, per-pixel gain, monotone list.
  list,
  /// The paper's single-image list as its authors run it: whole grey levels, list, two 7×7 Gaussian
  /// filters. The list's entries below the threshold are 0 and the threshold's own depth is already
  /// taken off the others (calibration/published.hpp); the light's gain is not applied.
  published
};

/// All that a calibration fixes. Immutable and shared between threads once made.
struct Model {
  Method method = Method::list;
  RectifyTable rectify;  ///< Camera frame → depth map.
  double mm_per_px = 0;  ///< Millimetres per pixel of the depth map.
  /// Standard deviation of the Gaussian that smooths the difference, pixels of the depth map, 0 …
  /// 10. Method::published has filters of its own and ignores it.
  double smoothing_px = 0;
  DepthList list;
  /// What the list is uncertain by: mean absolute error in micrometres at some indentations,
  /// ascending. Empty: not known.
  struct Uncertainty {
    double depth_mm = 0;
    double error_um = 0;
  };
  std::vector<Uncertainty> uncertainty;
  /// How the layer spreads light sideways, as fitted. None: not known, nothing can be sharpened.
  std::optional<Scattering> scattering;
  /// A list holds for the levels of one filter only: these are for levels sharpened by so many
  /// steps. Ascending, each of 1 and 2 at most once; with `scattering` and Method::list only.
  struct Sharpened {
    int steps = 0;
    DepthList list;
    std::vector<Uncertainty> uncertainty;
  };
  std::vector<Sharpened> sharpened;
  SpatialGain gain;  ///< Of Method::list.
  /// The untouched image at calibration time, frame sized, Q8 luma (0…65280), row-major without
  /// padding: brings a differently lit image back to the calibration's light.
  std::vector<std::uint16_t> reference_q8;
  /// Depth-map sized; non-zero marks pixels that are never trusted. Empty: none.
  std::vector<std::uint8_t> untrusted;
  std::optional<ForceModel> force;  ///< None: not calibrated.
  Surface surface;  ///< That the indentation is measured from; says where in space a pixel lies.
};

/// Throws std::invalid_argument, naming the part, where the parts do not fit each other.
void check(const Model& model);

}  // namespace dtact::recon
