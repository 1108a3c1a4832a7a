#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "clients/perceive/pose/contact_view.hpp"
#include "clients/perceive/pose/motion.hpp"

namespace dtact::perceive {

/// How surfels lie on the gel of a view.
struct Alignment {
  Motion motion = Motion::Identity();
  double rms = 0;      ///< RMS of the distances along the normals, for points that count, metres.
  double overlap = 0;  ///< Share of the surfels that count.
  double fit = 0;      ///< Share of the surfels compared that count: the others lie elsewhere.
  std::size_t points = 0;  ///< Number of those.
  /// Covariance of the error of `motion`, as a motion after it about the origin: rotation
  /// (radians), then translation (metres). Huge along directions that the shape does not determine.
  Matrix6 covariance = Matrix6::Zero();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< Mean of the moved surfels, metres.
  double arm = 0;                                    ///< Their root mean square distance from it.
};

/// Point-to-plane ICP with projective association: brings `surfels` onto the gel that `view` shows,
/// starting at `start`. Each surfel is compared with the gel above or below it along the undeformed
/// surface's normal; Gauss-Newton with Tukey's weights. Where neither the gel nor the surfel is
/// pressed, nothing is compared. There is no motion along unobservable directions (a ball's
/// rotations, a plate's sliding), except to minimise the rotation. So a sliding ball slides and
/// does not roll.
[[nodiscard]] Alignment align(std::span<const Surfel> surfels, const ContactView& view,
                              const Motion& start);

/// The covariance (as in Alignment) of an error that is unknown along the unit `twists` and 0 along
/// all others. Twists are about `centre`, with rotations times `arm`.
[[nodiscard]] Matrix6 unknown_along(std::span<const Twist> twists, const Eigen::Vector3d& centre,
                                    double arm);

/// Directions in which the standard deviation of `covariance` (as Alignment has it) exceeds 0.3 mm:
/// unit twists about `centre`, their rotation times `arm`.
[[nodiscard]] std::vector<Twist> unobservable_of(const Matrix6& covariance,
                                                 const Eigen::Vector3d& centre, double arm);

/// The covariance of the error of `after` · M, where M has `covariance` and `after` is exact.
[[nodiscard]] Matrix6 carried(const Matrix6& covariance, const Motion& after);

}  // namespace dtact::perceive
