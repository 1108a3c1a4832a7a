#pragma once

#include <cstdint>
#include <vector>

#include "daemon/recon/model.hpp"

/// The benchmarks' input: a camera frame of 800×600 with barrel distortion, a depth map of
/// 580×580, one ball pressed into a gel that bulges around it. Synthetic: a light field, noise of
/// one grey level and a radial profile shaped like sensor_a's (shared/data), no mechanics.
namespace dtact::bench {

inline constexpr int kFrameWidth = 800;
inline constexpr int kFrameHeight = 600;
inline constexpr int kMapSide = 580;
inline constexpr int kLastGrey = 60;  ///< Darkening in the middle of the contact, grey levels.

/// Position in the camera frame of each pixel of the depth map, pixels: row-major kMapSide².
struct LensMap {
  std::vector<float> x;
  std::vector<float> y;
};
[[nodiscard]] LensMap make_lens_map();

/// The same as a table of the reconstruction.
[[nodiscard]] recon::RectifyTable make_lens_table(const LensMap& map);

/// A LUT of one slope on each side of zero (32 µm a level pressed, 9 µm a level bulged), method
/// `list`, smoothing of two pixels: as wide as the paper's two 7×7 filters together.
[[nodiscard]] recon::Model make_model();

using Image = std::vector<std::uint8_t>;  ///< kFrameWidth × kFrameHeight grey.

/// The reference image without noise, Q8.
[[nodiscard]] std::vector<std::uint16_t> make_reference_q8();

/// A ball's press whose changed area (contact and bulge) has `radius_px` in the frame; 0: no
/// contact. `seed` chooses the noise.
[[nodiscard]] Image make_frame(double radius_px, unsigned seed);

/// A baseline JPEG, 4:2:2 as cameras send it, quality 90.
[[nodiscard]] std::vector<std::uint8_t> make_jpeg(const Image& frame);

}  // namespace dtact::bench
