#pragma once

namespace dtact::recon {

/// Light that is scattered sideways in the layer: a point's loss of light appears as the sum of two
/// Gaussians round it.
struct Scattering {
  double narrow_mm = 0;      ///< Standard deviation, 0.01 … 5 mm.
  double wide_mm = 0;        ///< Standard deviation, above narrow_mm, at most 20 mm.
  double narrow_weight = 0;  ///< Share of the light in the narrow one, 0 … 1; the rest is wide.

  bool operator==(const Scattering&) const = default;
};

inline constexpr double kNarrowestMm = 0.01;
inline constexpr double kWidestNarrowMm = 5;
inline constexpr double kWidestMm = 20;

/// Greatest number of Van Cittert's steps (sharpener.hpp): a third sharpens more and costs noise.
inline constexpr int kMostSharpeningSteps = 2;

/// Levels are sharpened at 1/kSharpenedAt of the calibration's resolution in each direction, which
/// the layer's own blur leaves enough of.
inline constexpr int kSharpenedAt = 4;

/// Throws std::invalid_argument, naming the key as in calibration.toml, outside those ranges.
void check(const Scattering& scattering);

}  // namespace dtact::recon
