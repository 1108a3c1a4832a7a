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

/// No gel explains the presses: what() says what to check.
class ModelRefused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The darkening of a press on rings about the contact's centre, as a share of the light there.
struct PressProfile {
  std::vector<double> radius_mm;
  std::vector<double> loss;
  std::vector<double> noise;  ///< Standard error of each mean by the pixels' noise.
  double ball_radius_mm = 0;
  double contact_radius_mm = 0;  ///< Start value, from find_contact().
  double smoothing_mm = 0;       ///< The map's.
};

/// `light_levels`: the grey level that the press's map counts as all of the light: the mean of the
/// reference where the gain is uniform. Rings of which the map, or `use`, leaves less than a third
/// are left out.
[[nodiscard]] PressProfile profile_of(const SymmetricPress& press, double light_levels,
                                      double smoothing_mm, const PixelFilter& use = {});

/// A gel fitted to presses.
struct ModelFit {
  /// Places in `parameters`: logarithms of thickness, the two widths, the odds of the narrow one,
  /// five slopes, and the bulge's factor.
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
    double offset = 0;    ///< Share of the light that the whole press is darker by.
    double residual = 0;  ///< Root mean square over the rings, share of the light.
  };
  std::vector<Press> presses;
  double residual = 0;  ///< Over all.
  /// The fitted values (Parameter) and their covariance: (JᵀJ)⁻¹ with the priors, and the residual
  /// as the noise.
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;

  [[nodiscard]] double deepest_mm() const;
  /// What is left is what a fit leaves whose gel is right: a hundredth of a grey level of 160, of
  /// noise and of steps of a pixel. On simulated sensors of the same law that nothing was chosen on
  /// it is half to two of that, on one of another law three to four; on two real presses six and
  /// twenty.
  [[nodiscard]] bool explains() const noexcept;
};

/// What a frame's pixels are off by, in grey levels.
inline constexpr double kFrameNoise = 1;

/// The gel of such parameters.
[[nodiscard]] GelModel gel_of(const Eigen::VectorXd& parameters);

/// Analysis by synthesis: thickness, response and scattering that all presses share, each with its
/// own contact radius and offset, by Levenberg and Marquardt (Ceres) from several thicknesses. The
/// priors are wide (model_fit.cpp): thickness 2 mm ± 35 %, widths 0.3 and 1.5 mm ± 50 %. A kink of
/// the response at zero is held narrower (± 30 %): one press hardly tells it from thickness.
/// A fit that is still creeping after 30 steps is taken as it is then; its residual says what it is
/// worth. Throws ModelRefused when no fit begins to explain anything.
[[nodiscard]] ModelFit fit_model(std::span<const PressProfile> presses);
/// The same from the parameters of another fit, as of one of the presses.
[[nodiscard]] ModelFit fit_model(std::span<const PressProfile> presses, const ModelFit& from);

}  // namespace dtact::calibration
