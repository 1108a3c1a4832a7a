#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::image {

/// An 8-bit grey image, row-major without padding.
struct Grey8 {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
};

/// A 16-bit grey image, row-major without padding.
struct Grey16 {
  int width = 0;
  int height = 0;
  std::vector<std::uint16_t> pixels;
};

/// An 8-bit colour image, r g b, row-major without padding.
struct Rgb8 {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
};

/// Limits of any PNG that is read: 8192x8192 pixels are more than any camera's mode.
inline constexpr std::uint32_t kMaxPngSide = 16384;
inline constexpr std::uint64_t kMaxPngPixels = std::uint64_t{1} << 26U;

/// What a PNG says of itself before its pixels.
struct PngHeader {
  int width = 0;      ///< Pixels.
  int height = 0;     ///< Pixels.
  int bits = 0;       ///< Of a sample: 1, 2, 4, 8 or 16.
  bool grey = false;  ///< Grey without transparency.
};

/// Reads the first bytes only. Throws std::runtime_error, which contains `name`, for what is no PNG
/// or beyond the limits.
[[nodiscard]] PngHeader png_header(std::string_view bytes, const std::string& name);

/// A PNG as 8-bit grey. Colour becomes luma by ITU-R BT.601 (0.299 r + 0.587 g + 0.114 b, rounded),
/// like a JPEG's luma; 16-bit is reduced by rounding; transparency is ignored. Throws
/// std::runtime_error naming `path`.
[[nodiscard]] Grey8 read_png_grey8(const std::filesystem::path& path);

/// The same at 16 bits, full scale 65535 = white: an 8-bit value v becomes 257 v.
[[nodiscard]] Grey16 read_png_grey16(const std::filesystem::path& path);
/// A PNG in memory; error messages contain `name`.
[[nodiscard]] Grey16 decode_png_grey16(std::string_view bytes, const std::string& name);

[[nodiscard]] std::string encode_png(const Grey8& image);
[[nodiscard]] std::string encode_png(const Grey16& image);
[[nodiscard]] std::string encode_png(const Rgb8& image);

}  // namespace dtact::image
