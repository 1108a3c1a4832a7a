#include "clients/common/depth_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string_view>

#include "clients/common/colours.hpp"
#include "clients/common/exit_codes.hpp"
#include "clients/geometry/cloud_file.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"

namespace dtact::cli {
namespace {

void append_float(std::string& out, float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  for (unsigned shift = 0; shift < 32; shift += 8) {
    out += static_cast<char>(static_cast<std::uint8_t>(bits >> shift));
  }
}

perceive::PointCloud points_of(const DepthImage& depth) {
  // Micrometres, as they came.
  std::vector<std::int16_t> values;
  values.reserve(depth.mm.size());
  perceive::DepthGrid grid{.x = depth.x,
                           .y = depth.y,
                           .width = depth.width,
                           .height = depth.height,
                           .full_width = std::max(depth.full_width, depth.width),
                           .full_height = std::max(depth.full_height, depth.height),
                           .mm_per_px = depth.mm_per_px,
                           .values = {}};
  for (const float mm : depth.mm) {
    values.push_back(static_cast<std::int16_t>(
        std::isnan(mm) ? grid.untrusted : std::clamp(std::lround(1000 * mm), -32767L, 32767L)));
  }
  grid.values = values;
  perceive::PointCloud cloud;
  perceive::CloudMaker(depth.surface).make(grid, 1, cloud);
  return cloud;
}

std::string encode_points_ply(const DepthImage& depth) {
  return perceive::encode_ply(points_of(depth));
}

std::string encode_points_pcd(const DepthImage& depth) {
  return perceive::encode_pcd(points_of(depth));
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

// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
NpyArray read_npy(const std::filesystem::path& file) {
  const std::string bytes = base::read_file(file);
  const auto refuse = [&file] {
    throw std::runtime_error(file.string() +
                             ": is no array of float32 or float64 as NumPy saves it (.npy)");
  };
  const auto unsigned_at = [&bytes](std::size_t at, std::size_t count) {
    std::uint64_t value = 0;
    for (std::size_t i = count; i-- > 0;) {
      value = value << 8U | static_cast<std::uint8_t>(bytes[at + i]);
    }
    return value;
  };
  constexpr std::size_t kBefore = 8;  // magic and version
  if (bytes.size() < kBefore + 4 || !bytes.starts_with("\x93NUMPY")) refuse();
  const std::size_t length = bytes[6] == 1 ? 2 : 4;
  const std::size_t data = kBefore + length + unsigned_at(kBefore, length);
  if (data > bytes.size()) refuse();
  const std::string header = bytes.substr(kBefore, data - kBefore);
  const bool is_double = header.find("'<f8'") != std::string::npos;
  const std::size_t size = is_double ? 8 : 4;
  const std::size_t shape = header.find("'shape': (");
  if ((!is_double && header.find("'<f4'") == std::string::npos) || shape == std::string::npos ||
      header.find("'fortran_order': False") == std::string::npos) {
    refuse();
  }
  const std::size_t count = (bytes.size() - data) / size;
  NpyArray array;
  std::size_t product = 1;
  const char* at = header.c_str() + shape + std::string_view("'shape': (").size();
  while (*at >= '0' && *at <= '9') {
    char* end = nullptr;
    array.shape.push_back(std::strtoull(at, &end, 10));
    // Checked before it is multiplied, so that it does not overflow.
    if (array.shape.back() == 0 || array.shape.back() > count) refuse();
    product = std::min(product * array.shape.back(), count + 1);
    for (at = end; *at == ',' || *at == ' ';) ++at;
  }
  if (*at != ')' || product != count || data + count * size != bytes.size()) refuse();
  array.values.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t bits = unsigned_at(data + size * i, size);
    array.values.push_back(is_double ? std::bit_cast<double>(bits)
                                     : std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
  }
  return array;
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

double deepest_mm(std::span<const float> mm) {
  double deepest = 0;
  for (const float value : mm) deepest = std::fmax(deepest, value);
  return deepest;
}

std::string encode_colour_png(const DepthImage& depth) {
  const double full_mm = full_scale_mm(deepest_mm(depth.mm));
  image::Rgb8 picture{depth.width, depth.height, {}};
  picture.pixels.reserve(3 * depth.mm.size());
  for (const float mm : depth.mm) {
    const Colour colour = std::isnan(mm) ? kUntrustedColour : colour_of(mm / full_mm);
    picture.pixels.insert(picture.pixels.end(), {colour.r, colour.g, colour.b});
  }
  return image::encode_png(picture);
}

DepthEncoder encoder_for(const std::string& path, DepthEncoder png) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".npy") return encode_npy;
  if (ending == ".png") return png;
  if (ending == ".ply") return encode_points_ply;
  if (ending == ".pcd") return encode_points_pcd;
  throw Failure(kUsage, path + ": the name must end in .npy, .png, .ply or .pcd");
}

}  // namespace dtact::cli
