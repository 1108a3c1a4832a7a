#pragma once

#include <opencv2/core.hpp>

namespace dtact::hal::sim {

/// What a press does to the gel. Matrices are the grid's size, double.
struct Pressed {
  cv::Mat1d indentation_mm;  ///< Positive = pressed, negative = bulge.
  cv::Mat1d pressure;        ///< in units of Young's modulus; > 0 exactly in contact
  int iterations = 0;
};

/// A linear-elastic gel bonded to a stiff block, on a periodic grid. The surface responds to a
/// pressure p with û(k) = C(k)·p̂(k),
///
///     C(k) = 2(1 − ν²)/(E·k) · ((3 − 4ν)·sinh 2kh − 2kh)
///                            / ((3 − 4ν)·cosh 2kh + 2(kh)² + 5 − 12ν + 8ν²)
///     C(0) = h·(1 + ν)(1 − 2ν)/(E·(1 − ν))
///
/// (K. L. Johnson, Contact Mechanics, section 5.8.) For ν = 0.5, an incompressible gel, C(0) = 0:
/// the volume is conserved. E cancels for a press of given depth and is 1 here; the force on the
/// object is the sum of the pressure times Young's modulus times a grid point's area.
class ElasticLayer {
 public:
  /// Grid points `spacing_mm` apart; sizes whose prime factors are 2, 3, 5 are fast.
  /// `poisson`: Poisson's ratio ν, 0 to 0.5.
  ElasticLayer(int width, int height, double spacing_mm, double thickness_mm, double poisson = 0.5);

  /// The frictionless contact with a rigid surface: indentation ≥ target everywhere, pressure ≥ 0,
  /// and no pressure where they part. `target_mm`: object's depth minus its height, grid sized,
  /// very negative where there is no object. `guess` (empty or grid sized) is a pressure to start
  /// from. Throws std::runtime_error when no solution is found within 2,000 iterations: a press
  /// that fills the grid has none.
  [[nodiscard]] Pressed solve(const cv::Mat1d& target_mm, const cv::Mat1d& guess) const;

  /// The surface's answer to a pressure, mm.
  [[nodiscard]] cv::Mat1d indentation(const cv::Mat1d& pressure) const;

 private:
  cv::Mat1d compliance_;  // C(k), laid out as cv::dft packs the spectrum of a real matrix
};

}  // namespace dtact::hal::sim
