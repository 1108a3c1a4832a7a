#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "daemon/recon/gel_response.hpp"
#include "daemon/recon/tiles.hpp"

namespace dtact::recon {

/// A normal force, newtons, and the mean absolute error to expect of it.
struct Force {
  double newtons = 0;  ///< ≥ 0
  double uncertainty_n = 0;
};

/// Why a contact comes without a force, in the numbers of dtact.v1.ForceAbsence.
enum class ForceAbsence : std::uint8_t {
  none = 0,                ///< It has one.
  uncalibrated = 1,        ///< The calibration has no force.
  beyond_calibration = 2,  ///< Part of the contact is deeper than the calibration covers.
  cut_off = 3              ///< The contact reaches the map's edge or pixels that are not trusted.
};

/// The force of an incompressible gel bonded to a stiff block (GelResponse), as readings of a
/// scale calibrated it: with the indentation u + zero_mm and Young's modulus,
///
///     F = modulus_mpa ∫ q (u + zero_mm) dA.
struct ForceModel {
  double modulus_mpa = 0;
  double thickness_mm = 0;  ///< the gel thickness
  double zero_mm = 0;       ///< What depth maps lack where something presses.
  double error_share = 0;   ///< Error of readings left out of the fit over the force.
  int pairs = 0;            ///< Readings that made it, …
  double from_n = 0;        ///< … the smallest and the greatest of them.
  double to_n = 0;
};

/// The force of a contact in a map with an uncertainty of `uncertainty_mm`.
///
/// The force's uncertainty adds three parts in squares: a share of the depth's times the contact's
/// stiffness, a share of the force for the law, and the force of a contact too light to see. It
/// grows beyond the greatest reading.
[[nodiscard]] Force force_of(const ForceModel& model, const GelResponse::Answer& answer,
                             double uncertainty_mm) noexcept;

/// Measures the force in depth maps of one shape. One thread at a time; does not allocate after
/// construction.
class ForceMeter {
 public:
  ForceMeter(const ForceModel& model, int width, int height, double mm_per_px);

  struct Reading {
    std::optional<Force> force;
    ForceAbsence absence = ForceAbsence::none;
  };
  /// The reading for a contact. `tiles`: where the map is not 0.
  [[nodiscard]] Reading read(std::span<const std::int16_t> depth_um, const TileRows& tiles,
                             double uncertainty_mm) noexcept;
  /// Outside the contact.
  [[nodiscard]] Force none() const noexcept { return force_of(model_, {}, 0); }

 private:
  ForceModel model_;
  CellMap cells_;
  GelResponse response_;
};

}  // namespace dtact::recon
