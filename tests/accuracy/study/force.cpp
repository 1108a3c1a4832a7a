#include "tests/accuracy/study/force.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>

#include "hal/sim/elastic_layer.hpp"

namespace dtact::study {

std::vector<double> force_over_modulus(const hal::sim::GelModel& gel,
                                       const hal::sim::Object& object,
                                       std::span<const double> depths_mm) {
  constexpr double kSpacing_mm = 0.1;
  constexpr double kMargin = 4;  // thicknesses on either side: there the bulge is a thousandth
  const int side = cv::getOptimalDFTSize(static_cast<int>(
      std::ceil(2 * (object.reach_mm + kMargin * gel.thickness_mm) / kSpacing_mm)));
  const hal::sim::ElasticLayer solver(side, side, kSpacing_mm, gel.thickness_mm, gel.poisson);
  std::vector<double> forces;
  cv::Mat1d pressure;
  const int middle = side / 2;
  for (const double depth : depths_mm) {
    cv::Mat1d target(side, side);
    for (int row = 0; row < side; ++row) {
      for (int column = 0; column < side; ++column) {
        target(row, column) =
            depth - object.height_mm((column - middle) * kSpacing_mm, (row - middle) * kSpacing_mm);
      }
    }
    pressure = solver.solve(target, pressure).pressure;
    forces.push_back(cv::sum(pressure)[0] * kSpacing_mm * kSpacing_mm);
  }
  return forces;
}

double hertz_zero_mm(std::span<const double> depths_mm, std::span<const double> forces) {
  const auto n = static_cast<double>(depths_mm.size());
  double sd = 0, sf = 0, sdd = 0, sdf = 0;
  for (std::size_t i = 0; i < depths_mm.size(); ++i) {
    const double f = std::pow(forces[i], 2.0 / 3);
    sd += depths_mm[i];
    sf += f;
    sdd += depths_mm[i] * depths_mm[i];
    sdf += depths_mm[i] * f;
  }
  const double slope = (n * sdf - sd * sf) / (n * sdd - sd * sd);
  return (sd - sf / slope) / n;
}

}  // namespace dtact::study
