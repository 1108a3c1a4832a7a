#pragma once

#include <array>
#include <cstddef>

namespace dtact::calibration {

/// Six-point Gauss-Legendre quadrature on [-1, 1], exact for polynomials of degree 11 (Abramowitz
/// and Stegun 1964, table 25.4).
inline constexpr std::array<double, 6> kGaussNodes = {-0.932469514203152, -0.661209386466265,
                                                      -0.238619186083197, 0.238619186083197,
                                                      0.661209386466265,  0.932469514203152};
inline constexpr std::array<double, 6> kGaussWeights = {0.171324492379170, 0.360761573048139,
                                                        0.467913934572691, 0.467913934572691,
                                                        0.360761573048139, 0.171324492379170};

/// Calls `add(place, weight)` for the six points of [from, to].
template <typename Add>
void for_gauss_points(double from, double to, const Add& add) {
  const double half = 0.5 * (to - from);
  for (std::size_t i = 0; i < kGaussNodes.size(); ++i) {
    add(from + half * (1 + kGaussNodes[i]), half * kGaussWeights[i]);
  }
}

}  // namespace dtact::calibration
