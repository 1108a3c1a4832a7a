#include "daemon/recon/force.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::recon {
namespace {

// What held-out objects leave after calibrations with one ball (tests/accuracy/force): errors of a
// depth map cancel over a contact but for a fifth, the law itself misses by a twentieth of the
// force.
constexpr double kDepthShare = 0.2;
constexpr double kLawShare = 0.05;
constexpr double kBeyondShare = 0.05;  // of what exceeds the greatest reading
// A disc of 0.4 mm radius pressed 0.1 mm is no contact to the daemon by default: 8/3 a d.
constexpr double kUnseenMm2 = 0.1;

}  // namespace

Force force_of(const ForceModel& model, const GelResponse::Answer& answer,
               double uncertainty_mm) noexcept {
  const double e = model.modulus_mpa;
  const double newtons = std::max(0.0, e * (answer.mm2 + model.zero_mm * answer.mm));
  const double depth_n = kDepthShare * e * answer.mm * uncertainty_mm;
  const double share = std::hypot(kLawShare, model.error_share);
  return {newtons, std::hypot(depth_n, share * newtons, kUnseenMm2 * e) +
                       kBeyondShare * std::max(0.0, newtons - model.to_n)};
}

ForceMeter::ForceMeter(const ForceModel& model, int width, int height, double mm_per_px)
    : model_(model), cells_(width, height, mm_per_px), response_(model.thickness_mm, cells_) {}

ForceMeter::Reading ForceMeter::read(std::span<const std::int16_t> depth_um, const TileRows& tiles,
                                     double uncertainty_mm) noexcept {
  cells_.read(depth_um, tiles);
  if (cells_.cut_off()) return {{}, ForceAbsence::cut_off};
  return {force_of(model_, response_.answer(cells_), uncertainty_mm)};
}

}  // namespace dtact::recon
