#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/recon/model.hpp"
#include "daemon/recon/sharpen_kernels.hpp"
#include "daemon/recon/smoother.hpp"

namespace dtact::recon {

/// Rows [y0, y1) and blocks of 32 columns [first, last) of a map.
struct MapArea {
  int y0 = 0;
  int y1 = 0;
  int first = 0;
  int last = 0;
  bool operator==(const MapArea&) const = default;
};

/// Sharpens levels L against the gel's scattering H by Van Cittert's steps: x₀ = L, x ← x + L − Hx
/// (P. H. van Cittert, "Zum Einfluß der Spaltbreite auf die Intensitätsverteilung in
/// Spektrallinien. II", Z. Phys. 69, 1931). What H keeps of a pattern, h, becomes 1 − (1 − h)ⁿ⁺¹
/// after n steps, and noise that H blurs away is n + 1 times as strong. The narrow Gaussian runs on
/// the map, the wide one on means of kCoarse × kCoarse pixels, read bilinearly; the map's edge is
/// replicated. In fixed point, bit for bit the scalar kernels. Allocates in the constructor only.
class Sharpener {
 public:
  /// For a map of `width` × `height` pixels of `mm_per_px`. Throws std::invalid_argument, naming
  /// the key and the greatest value, where a Gaussian is too wide for the map's scale.
  Sharpener(const Scattering& scattering, int steps, double mm_per_px, int width, int height);

  /// Pixels on every side that a result depends on.
  [[nodiscard]] int reach() const noexcept { return steps_ * step_reach(); }
  /// Where levels must be for run(), clipped to the map; y0 and y1 are multiples of kCoarse, as
  /// `area`'s are, or the map's height.
  [[nodiscard]] MapArea needed(MapArea area) const noexcept;
  /// Row y of the levels: write whole blocks of those that are needed.
  [[nodiscard]] std::int16_t* level(int y) noexcept { return level_.row(y); }
  /// Sharpens an area.
  void run(const MapArea& area) noexcept;
  /// Row y of the last run's area.
  [[nodiscard]] const std::int16_t* sharpened(int y) noexcept { return sharpened_.row(y); }

  /// Values from one such row to the next.
  [[nodiscard]] std::ptrdiff_t stride() const noexcept { return sharpened_.stride(); }

  /// Whether neither Gaussian is too wide for a map of that scale.
  [[nodiscard]] static bool reaches(const Scattering& scattering, double mm_per_px) noexcept;

  /// Taps of the two Gaussians, Q14 from the centre outwards. The wide one is on the coarse grid,
  /// narrower by the blur of the means and of bilinear reading.
  [[nodiscard]] static std::vector<std::int16_t> narrow_taps(const Scattering& scattering,
                                                             double mm_per_px);
  [[nodiscard]] static std::vector<std::int16_t> wide_taps(const Scattering& scattering,
                                                           double mm_per_px);
  /// Share of the wide Gaussian.
  [[nodiscard]] static std::int16_t wide_share_q15(const Scattering& scattering) noexcept;

 private:
  [[nodiscard]] int step_reach() const noexcept;
  [[nodiscard]] MapArea widened(MapArea area) const noexcept;
  void step(RowBuffer& from, const MapArea& area) noexcept;
  void shrink(RowBuffer& from, const MapArea& area) noexcept;
  void blur_coarse(const MapArea& area) noexcept;
  [[nodiscard]] kernels::WideRows wide_rows(int y) noexcept;

  int steps_;
  int width_;
  int height_;
  int coarse_width_;
  int coarse_height_;
  std::int16_t wide_share_q15_;
  Smoother narrow_;
  Smoother wide_;
  RowBuffer level_;
  RowBuffer sharpened_;
  RowBuffer blurred_;         ///< A pair of rows under the narrow Gaussian.
  RowBuffer coarse_;          ///< Means.
  RowBuffer coarse_blurred_;  ///< Under the wide Gaussian.
};

}  // namespace dtact::recon
