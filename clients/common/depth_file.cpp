#include "clients/common/depth_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>

#include "clients/common/exit_codes.hpp"
#include "hal/image/png.hpp"

namespace dtact::cli {
namespace {

void append_float(std::string& out, float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  for (unsigned shift = 0; shift < 32; shift += 8) {
    out += static_cast<char>(static_cast<std::uint8_t>(bits >> shift));
  }
}

}  // namespace

std::string npy_head(const std::string& shape) {
  std::string header =
      fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': {}, }}", shape);
  // Magic, version, length and header fill whole 64 bytes, the last of which is a newline.
  constexpr std::size_t kBefore = 10;
  constexpr std::size_t kWhole = 128;
  header.append(kWhole - 1 - kBefore - header.size(), ' ');
  header += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  out += static_cast<char>(header.size() % 256);
  out += static_cast<char>(header.size() / 256);
  return out + header;
}

std::string npy_values(std::span<const float> values) {
  std::string out;
  out.reserve(4 * values.size());
  for (const float value : values) append_float(out, value);
  return out;
}

std::string encode_npy(const DepthImage& depth) {
  return npy_head(fmt::format("({}, {})", depth.height, depth.width)) + npy_values(depth.mm);
}

std::string encode_micrometre_png(const DepthImage& depth) {
  image::Grey16 picture{depth.width, depth.height, {}};
  picture.pixels.reserve(depth.mm.size());
  for (const float mm : depth.mm) {
    const float um = std::isnan(mm) ? 0 : std::clamp(1000 * mm, 0.0F, 65535.0F);
    picture.pixels.push_back(static_cast<std::uint16_t>(std::lround(um)));
  }
  return image::encode_png(picture);
}

std::string encode_ply(const DepthImage& depth) {
  std::string points;
  std::size_t count = 0;
  std::size_t pixel = 0;
  for (int y = 0; y < depth.height; ++y) {
    for (int x = 0; x < depth.width; ++x) {
      const float mm = depth.mm[pixel++];
      if (std::isnan(mm)) continue;
      append_float(points, static_cast<float>((x - 0.5 * (depth.width - 1)) * depth.mm_per_px));
      append_float(points, static_cast<float>((y - 0.5 * (depth.height - 1)) * depth.mm_per_px));
      append_float(points, -mm);
      ++count;
    }
  }
  return fmt::format(
             "ply\nformat binary_little_endian 1.0\n"
             "comment millimetres; x right, y down, z away from the camera; pressed is negative z\n"
             "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
             "end_header\n",
             count) +
         points;
}

DepthEncoder encoder_for(const std::string& path, DepthEncoder png) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".npy") return encode_npy;
  if (ending == ".png") return png;
  if (ending == ".ply") return encode_ply;
  throw Failure(kUsage, path + ": the name must end in .npy, .png or .ply");
}

}  // namespace dtact::cli
