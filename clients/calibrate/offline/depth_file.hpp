#pragma once

#include <span>
#include <string>

namespace dtact::ctl {

/// A depth map to write: millimetres, NaN where untrusted, row-major.
struct DepthImage {
  int width = 0;
  int height = 0;
  double mm_per_px = 0;
  std::span<const float> mm;
};

/// NumPy's .npy, format 1.0: float32 little-endian, shape (height, width).
[[nodiscard]] std::string encode_npy(const DepthImage& depth);

/// PLY, binary little-endian: a point for each trusted pixel, millimetres, in the surface's frame:
/// origin at the middle of the map, x to the right, y down, z away from the camera, so a pressed
/// point has negative z.
[[nodiscard]] std::string encode_ply(const DepthImage& depth);

/// PNG: the map in colours over a legend's numbers in millimetres, a bar of the scale below.
[[nodiscard]] std::string encode_colour_png(const DepthImage& depth);

}  // namespace dtact::ctl
