#include "clients/geometry/cloud_file.hpp"

#include <fmt/format.h>

#include <bit>
#include <concepts>
#include <cstdint>
#include <vector>

namespace dtact::perceive {
namespace {

template <std::unsigned_integral Word>
void append(Word word, std::string& out) {
  for (unsigned shift = 0; shift < 8 * sizeof word; shift += 8) {
    out += static_cast<char>(static_cast<std::uint8_t>(word >> shift));
  }
}

void append_point(const PointCloud& cloud, std::size_t index, std::string& out) {
  for (std::size_t part = 0; part < PointCloud::kParts; ++part) {
    append(std::bit_cast<std::uint32_t>(cloud.values[part * cloud.size() + index]), out);
  }
}

}  // namespace

std::string encode_ply(const PointCloud& cloud) {
  std::string body;
  std::vector<std::uint32_t> number(cloud.size());
  std::uint32_t points = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!cloud.has(i)) continue;
    number[i] = points++;
    append_point(cloud, i, body);
  }
  std::size_t triangles = 0;
  for_each_triangle(cloud, [&](std::size_t a, std::size_t b, std::size_t c) {
    append(std::uint8_t{3}, body);
    for (const std::size_t corner : {a, b, c}) append(number[corner], body);
    ++triangles;
  });
  return fmt::format(
             "ply\nformat binary_little_endian 1.0\n"
             "comment metres; x right, y down, z away from the camera; pressed is negative z\n"
             "element vertex {}\n"
             "property float x\nproperty float y\nproperty float z\n"
             "property float nx\nproperty float ny\nproperty float nz\n"
             "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
             points, triangles) +
         body;
}

std::string encode_pcd(const PointCloud& cloud) {
  std::string text = fmt::format(
      "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
      "FIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\nTYPE F F F F F F\n"
      "COUNT 1 1 1 1 1 1\nWIDTH {}\nHEIGHT {}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA binary\n",
      cloud.width, cloud.height, cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) append_point(cloud, i, text);
  return text;
}

}  // namespace dtact::perceive
