#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "daemon/recon/surface.hpp"

namespace dtact::cli {

/// A depth map to write: millimetres, NaN where untrusted, row-major.
struct DepthImage {
  int width = 0;
  int height = 0;
  double mm_per_px = 0;
  std::span<const float> mm;
  /// The whole map that it is a part of, where it is one: its first pixel there, and the size.
  int x = 0;
  int y = 0;
  int full_width = 0;  ///< 0: it is the whole.
  int full_height = 0;
  recon::Surface surface = {};  ///< Surface that depth is measured from.
};

/// The head of NumPy's .npy, format 1.0, for float32 little-endian: 128 bytes. `shape`: "(2, 3)".
[[nodiscard]] std::string npy_head(const std::string& shape);
/// The values as they follow it.
[[nodiscard]] std::string npy_values(std::span<const float> values);
/// Both, of shape (height, width).
[[nodiscard]] std::string encode_npy(const DepthImage& depth);

/// An array that NumPy saved.
struct NpyArray {
  std::vector<std::size_t> shape;
  std::vector<double> values;  ///< Row-major.
};
/// Reads a .npy file of float32 or float64, of at most 64 MiB. Throws std::runtime_error naming the
/// file.
[[nodiscard]] NpyArray read_npy(const std::filesystem::path& file);

/// A 16-bit PNG in micrometres: 0 where untrusted or less, 65535 where more.
[[nodiscard]] std::string encode_micrometre_png(const DepthImage& depth);

/// A PNG in colours (colours.hpp), from no indentation to full_scale_mm() of the deepest.
[[nodiscard]] std::string encode_colour_png(const DepthImage& depth);
/// The deepest, millimetres; 0 where nothing is pressed.
[[nodiscard]] double deepest_mm(std::span<const float> mm);

using DepthEncoder = std::string (*)(const DepthImage&);

/// What writes a file of this name: by its ending .npy, .ply or .pcd (points with normals, in the
/// surface's frame, metres) or, with `png`, .png. Throws Failure (wrong usage) for another.
[[nodiscard]] DepthEncoder encoder_for(const std::string& path, DepthEncoder png);

}  // namespace dtact::cli
