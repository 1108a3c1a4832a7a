#include "daemon/pipeline/depth/uncertainty.hpp"

#include <algorithm>
#include <array>
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

/// The part of the edge-hiding blur that remains after 0, 1 and 2 steps of sharpening, and how much
/// more a sharpened map bends than a plain one of the same object. Medians over the frames of
/// config/scenes/all_objects.toml (tests/accuracy/chart/auto_test.cpp): 0.54 and 0.33 of the plain
/// map's blur, 1.3 and 1.7 times its bend, with the scattering known exactly. A fitted one is
/// less exact: 0.6 and 0.4.
struct Sharpened {
  double left;
  double bend;
};
constexpr std::array<Sharpened, 3> kSharpened{{{1, 1}, {0.6, 1.3}, {0.4, 1.7}}};

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

double rim_factor(std::int64_t made, std::int64_t beyond) noexcept {
  if (made == 0) return 1;
  return std::sqrt(1 + static_cast<double>(beyond) / static_cast<double>(made));
}

double uncertainty_um(double lut_um, double bend_um) noexcept {
  return std::hypot(lut_um, kBlurPerBend * bend_um);
}

double uncertainty_at_um(double lut_um, double bend_um, int decimation, int steps) noexcept {
  const double left = kSharpened[static_cast<std::size_t>(steps)].left;
  return uncertainty_um(lut_um, left * bend_um) + added(decimation) * bend_um;
}

double plain_bend_um(double bend_um, int steps) noexcept {
  return bend_um / kSharpened[static_cast<std::size_t>(steps)].bend;
}

std::size_t ResolutionChooser::next(std::span<const double> expected_um) noexcept {
  const std::size_t before = index_;
  const auto outside = [this](double um) { return um > max_error_um_; };
  if (outside(expected_um[index_])) {
    const auto inside = std::find_if_not(expected_um.begin() + static_cast<std::ptrdiff_t>(index_),
                                         expected_um.end(), outside);
    // The last of the least.
    const auto least = std::min_element(expected_um.rbegin(), expected_um.rend()).base() - 1;
    index_ = static_cast<std::size_t>((inside == expected_um.end() ? least : inside) -
                                      expected_um.begin());
  }
  const bool roomy =
      index_ == before && index_ > 0 && expected_um[index_ - 1] <= kMargin * max_error_um_;
  patient_ = roomy ? patient_ + 1 : 0;
  if (patient_ >= kPatience) {
    --index_;
    patient_ = 0;
  }
  return index_;
}

}  // namespace dtact::pipeline
