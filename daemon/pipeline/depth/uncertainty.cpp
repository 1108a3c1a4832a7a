#include "daemon/pipeline/depth/uncertainty.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "daemon/recon/model.hpp"

namespace dtact::pipeline {
namespace {

/// Of a full map every so many rows are looked at: the layer blurs over several.
constexpr int kRowStep = 4;

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

double bend_um(std::span<const std::int16_t> depth_um, const recon::TileGrid& grid,
               const recon::TileRows& drawn, double mm_per_px, std::int16_t from_um) noexcept {
  const int reach = std::max(1, static_cast<int>(std::lround(kBendMm / mm_per_px)));
  const int row_step = std::min(kRowStep, reach);
  const std::ptrdiff_t below = std::ptrdiff_t{reach} * grid.width;
  std::int64_t sum = 0;  // of |four neighbours − 4 × pixel|
  std::int64_t pixels = 0;
  for (int y = reach; y < grid.height - reach; y += row_step) {
    recon::for_each_run(
        drawn[static_cast<std::size_t>(y / recon::TileGrid::kRows)], [&](int first, int last) {
          const int x1 = std::min(last * grid.tile_width(), grid.width - reach);
          const std::int16_t* const row = depth_um.data() + std::ptrdiff_t{y} * grid.width;
          for (int x = std::max(first * grid.tile_width(), reach); x < x1; ++x) {
            const std::int16_t* const at = row + x;
            if (*at <= from_um) continue;
            const int least = std::min({at[-reach], at[reach], at[-below], at[below]});
            if (least == recon::kUntrusted) continue;
            sum += std::abs(at[-reach] + at[reach] + at[-below] + at[below] - 4 * *at);
            ++pixels;
          }
        });
  }
  if (pixels == 0) return 0;
  // Bends grow with the square of the distance they are taken over.
  const double distance = reach * mm_per_px / kBendMm;
  return static_cast<double>(sum) / static_cast<double>(pixels) / 2 / (distance * distance);
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
