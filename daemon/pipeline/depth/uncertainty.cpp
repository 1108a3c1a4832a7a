#include "daemon/pipeline/depth/uncertainty.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::pipeline {
namespace {

/// Added error at 1/decimation of the resolution, in bends.
double added(int decimation) noexcept {
  switch (decimation) {
    case 4:
      return 0.31;
    case 2:
      return 0.085;
    default:
      return 0;
  }
}

}  // namespace

int bend_reach(double mm_per_px) noexcept {
  return std::max(1, static_cast<int>(std::lround(kBendMm / mm_per_px)));
}

double bend_um(const recon::DepthSums& sums, double mm_per_px) noexcept {
  if (sums.bent == 0) return 0;
  // Bends grow with the square of the distance they are taken over.
  const double distance = sums.rules.bend_reach * mm_per_px / kBendMm;
  return static_cast<double>(sums.bend_um) / static_cast<double>(sums.bent) / 2 /
         (distance * distance);
}

double uncertainty_um(double list_um, double bend_um) noexcept {
  return std::hypot(list_um, kBlurPerBend * bend_um);
}

double uncertainty_at_um(double list_um, double bend_um, int decimation) noexcept {
  return uncertainty_um(list_um, bend_um) + added(decimation) * bend_um;
}

int ResolutionChooser::next(double list_um, double bend_um) noexcept {
  const auto fits = [&](int decimation, double bound) {
    return uncertainty_at_um(list_um, bend_um, decimation) <= bound;
  };
  const int before = decimation_;
  while (decimation_ > 1 && !fits(decimation_, max_error_um_)) decimation_ /= 2;
  const bool roomy =
      decimation_ == before && decimation_ < 4 && fits(decimation_ * 2, kMargin * max_error_um_);
  patient_ = roomy ? patient_ + 1 : 0;
  if (patient_ >= kPatience) {
    decimation_ *= 2;
    patient_ = 0;
  }
  return decimation_;
}

}  // namespace dtact::pipeline
