#include "hal/sim/texture.hpp"

#include <array>
#include <cmath>
#include <cstdint>

namespace dtact::hal::sim {
namespace {

// An even random number of unit variance for a lattice point: MurmurHash3's finaliser (Appleby).
double node(std::int64_t column, std::int64_t row) {
  auto x = (static_cast<std::uint64_t>(row) << 32U) ^ static_cast<std::uint32_t>(column);
  x = (x ^ (x >> 33U)) * 0xFF51AFD7ED558CCDU;
  x = (x ^ (x >> 33U)) * 0xC4CEB9FE1A85EC53U;
  x ^= x >> 33U;
  const double unit = static_cast<double>(x >> 11U) * 0x1.0p-53;
  return (2 * unit - 1) * std::sqrt(3.0);
}

std::array<double, 4> spline(double f) {
  const double g = 1 - f;
  return {g * g * g / 6, (3 * f * f * f - 6 * f * f + 4) / 6, (3 * g * g * g - 6 * g * g + 4) / 6,
          f * f * f / 6};
}

// What the weights leave of the nodes' variance along one axis, averaged over a cell: the cubic
// B-spline's square has the integral 151/315.
constexpr double kLeft = 151.0 / 315.0;

}  // namespace

Texture::Texture(double rms, double size_mm) noexcept : scale_(rms / kLeft), size_mm_(size_mm) {}

double Texture::at(const Place& place) const noexcept {
  if (scale_ == 0) return 0;
  const double u = place.x_mm / size_mm_;
  const double v = place.y_mm / size_mm_;
  const auto left = static_cast<std::int64_t>(std::floor(u));
  const auto top = static_cast<std::int64_t>(std::floor(v));
  const auto across = spline(u - static_cast<double>(left));
  const auto down = spline(v - static_cast<double>(top));
  double sum = 0;
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      sum += down[static_cast<std::size_t>(j)] * across[static_cast<std::size_t>(i)] *
             node(left + i, top + j);
    }
  }
  return scale_ * sum;
}

}  // namespace dtact::hal::sim
