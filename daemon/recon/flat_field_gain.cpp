#include "daemon/recon/flat_field_gain.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "daemon/recon/kernels.hpp"

namespace dtact::recon {
namespace {

std::int16_t saturated(double q6) noexcept {
  return static_cast<std::int16_t>(std::clamp(std::lround(q6), 0L, long{INT16_MAX}));
}

}  // namespace

double FlatFieldGain::polynomial_at(double x_mm, double y_mm) const noexcept {
  const std::array<double, 5> terms{x_mm, y_mm, x_mm * x_mm, x_mm * y_mm, y_mm * y_mm};
  double factor = 1;
  for (std::size_t i = 0; i < std::min(terms.size(), polynomial.size()); ++i) {
    factor += polynomial[i] * terms[i];
  }
  return std::max(0.0, factor);
}

FlatFieldGain moved(FlatFieldGain gain, double x_mm, double y_mm) {
  gain.centre_x_mm -= x_mm;
  gain.centre_y_mm -= y_mm;
  const double here = gain.polynomial_at(x_mm, y_mm);
  if (!(here > 0)) throw std::invalid_argument("gain: it is not above zero at the map");
  if (gain.polynomial.size() == 5) {  // the slopes at the new centre
    const double xy = gain.polynomial[3];
    gain.polynomial[0] += 2 * gain.polynomial[2] * x_mm + xy * y_mm;
    gain.polynomial[1] += 2 * gain.polynomial[4] * y_mm + xy * x_mm;
  }
  for (double& factor : gain.polynomial) factor /= here;
  return gain;
}

void apply(const FlatFieldGain& gain, const PlaneShape& shape,
           std::span<std::int16_t> reference_q6) noexcept {
  const auto row = [&](int y) {
    return reference_q6.data() + static_cast<std::ptrdiff_t>(y) * shape.stride;
  };
  if (gain.shape == GainShape::uniform) {
    double sum = 0;
    double count = 0;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (row(y)[x] < kernels::kDarkest_q6) continue;
        sum += row(y)[x];
        count += 1;
      }
    }
    const std::int16_t mean = saturated(count > 0 ? sum / count : 0);
    for (int y = 0; y < shape.height; ++y) std::fill_n(row(y), shape.width, mean);
  }
  if (gain.shape != GainShape::radial && gain.polynomial.empty()) return;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const double right = (x - 0.5 * (shape.width - 1)) * shape.mm_per_px;
      const double down = (y - 0.5 * (shape.height - 1)) * shape.mm_per_px;
      double factor = gain.polynomial_at(right, down);
      if (gain.shape == GainShape::radial) {
        factor *= 1 + gain.per_mm * std::hypot(right - gain.centre_x_mm, down - gain.centre_y_mm);
      }
      row(y)[x] = saturated(row(y)[x] * factor);
    }
  }
}

}  // namespace dtact::recon
