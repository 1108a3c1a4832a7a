#include "clients/calibrate/fit/lut_uncertainty.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "clients/calibrate/fit/lut_fit.hpp"

namespace dtact::calibration {
namespace {

constexpr double kZeroLevels = 1;    // grey levels
constexpr double kRingShare = 0.15;  // share of the ring's level scattered into the contact

/// Nothing where the press doesn't darken steadily.
std::optional<SagFit> line_of(const SettledPress& press) {
  try {
    return fit_sag(press.map, press.contact);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

}  // namespace

double ring_uncertainty_mm(const SettledPress& press, double slope) {
  const RadialProfile profile =
      radial_profile(press.map, press.contact, kFarField * press.contact.ball_radius_mm);
  double ring = 0;
  for (const double level : profile.levels) {
    if (!std::isnan(level)) ring = std::min(ring, level);
  }
  return -kRingShare * ring * slope;
}

std::vector<recon::Model::Uncertainty> uncertainty_of_zero(const recon::DepthLut& lut,
                                                           std::span<const SettledPress> presses,
                                                           std::optional<double> depth_mm) {
  struct Bin {
    double depth = 0;
    double error = 0;
    double zero = 0;
    double pixels = 0;
  };
  std::vector<Bin> bins;
  for (const SettledPress& press : presses) {
    const std::optional<SagFit> line = line_of(press);
    if (!line) continue;
    const double ring_mm = depth_mm ? 0 : ring_uncertainty_mm(press, line->slope);
    const double zero = std::hypot(kZeroLevels * line->slope, ring_mm);
    const double deepest_mm = depth_mm.value_or(line->depth_mm);
    const double ball = press.contact.ball_radius_mm;
    for (int y = 0; y < press.map.height; ++y) {
      for (int x = 0; x < press.map.width; ++x) {
        const double r = distance_mm(press.map, press.contact, x, y);
        const double level = press.map.at(x, y);
        if (!(r < press.contact.radius_mm) || std::isnan(level)) continue;
        const double read = lut_mm(lut, level);
        const auto at = static_cast<std::size_t>(std::max(0.0, read) / kDepthBinMm);
        if (at >= bins.size()) bins.resize(at + 1);
        bins[at].depth += read;
        bins[at].error += std::abs(read - (deepest_mm - sag_mm(ball, r)));
        bins[at].zero += zero;
        bins[at].pixels += 1;
      }
    }
  }
  std::vector<recon::Model::Uncertainty> rows;
  for (const Bin& bin : bins) {
    if (bin.pixels == 0) continue;
    const double read_mm = std::max(0.0, bin.depth / bin.pixels);
    const double error_mm = std::hypot(bin.error, bin.zero) / bin.pixels;
    rows.push_back({std::round(1000 * read_mm) / 1000, std::round(10000 * error_mm) / 10});
  }
  return rows;
}

}  // namespace dtact::calibration
