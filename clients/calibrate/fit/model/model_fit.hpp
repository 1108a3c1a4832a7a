#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "clients/calibrate/fit/lut_fit.hpp"
#include "clients/calibrate/fit/model/gel_model.hpp"
#include "clients/calibrate/fit/press_asymmetry.hpp"

namespace dtact::calibration {

/// No gel explains the presses: what() names what to check.
class ModelRefused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The darkening of a press on rings about the contact's centre, as a share of the light there.
struct PressProfile {
  std::vector<double> radius_mm;
  std::vector<double> loss;
  std::vector<double> noise;  ///< Standard error of each mean from the pixels' noise.
  double ball_radius_mm = 0;
  double contact_radius_mm = 0;  ///< Start value, from find_contact().
  double smoothing_mm = 0;       ///< Smoothing of the map.
};

/// `light_levels` is the grey level of full light in the press's map: the mean of the
/// reference where the gain is uniform. Rings with less than a third inside the map or `use`
/// are left out.
[[nodiscard]] PressProfile profile_of(const SymmetricPress& press, double light_levels,
                                      double smoothing_mm, const PixelFilter& use = {});

/// A gel fitted to presses.
struct ModelFit {
  /// Indices into `parameters`: logarithms of thickness, the two widths, the odds of the narrow
  /// one, five slopes, and the bulge's factor.
  enum Parameter : std::uint8_t {
    kThickness,
    kNarrow,
    kWide,
    kOdds,
    kSlopes,
    kBulge = kSlopes + 5
  };

  GelModel gel;
  struct Press {
    double contact_radius_mm = 0;
    double depth_mm = 0;
    double offset = 0;    ///< Darkening of the whole press, share of the light.
    double residual = 0;  ///< Root mean square over the rings, share of the light.
  };
  std::vector<Press> presses;
  double residual = 0;  ///< Residual over all presses.
  /// The fitted values (Parameter) and their covariance: (JᵀJ)⁻¹ with the priors, and the residual
  /// as the noise.
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;

  [[nodiscard]] double deepest_mm() const;
  /// Whether the residual is that of the right gel: a hundredth of a grey level of 160, from
  /// noise and from steps of a pixel. On simulated sensors of the same law that no constant was
  /// chosen on it is half to two of that, on one of another law three to four; on two real presses
  /// six and twenty.
  [[nodiscard]] bool explains() const noexcept;
};

/// Error of a frame's pixel, grey levels.
inline constexpr double kFrameNoise = 1;

/// The gel of a vector of parameters.
[[nodiscard]] GelModel gel_of(const Eigen::VectorXd& parameters);

/// Analysis by synthesis: all presses share thickness, response and scattering; each has its
/// own contact radius and offset, by Levenberg and Marquardt (Ceres) from several thicknesses. The
/// priors are wide (model_fit.cpp): thickness 2 mm ± 35 %, widths 0.3 and 1.5 mm ± 50 %. A kink of
/// the response at zero has a narrower prior (± 30 %): one press hardly separates it from
/// thickness. A fit that still changes after 30 steps is used as it is then; its residual shows its
/// quality. Throws ModelRefused when no fit explains anything.
[[nodiscard]] ModelFit fit_model(std::span<const PressProfile> presses);
/// The same, starting at the parameters of another fit, for example of one of the presses.
[[nodiscard]] ModelFit fit_model(std::span<const PressProfile> presses, const ModelFit& from);

}  // namespace dtact::calibration
