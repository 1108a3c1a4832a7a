#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::perceive {

/// A shape as a file has it, in the file's own unit: triangles that are counter-clockwise as seen
/// from outside or, where there are none, points with outward normals.
struct Mesh {
  std::vector<std::array<double, 3>> points;
  std::vector<std::array<double, 3>> normals;  ///< Normals of a cloud's points, any length but 0.
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

constexpr std::size_t kMaxMeshBytes = std::size_t{64} << 20U;
/// Throws std::runtime_error naming the file and the limit where `bytes` is above kMaxMeshBytes.
void check_mesh_size(std::uintmax_t bytes, const std::string& name);
/// Points, and triangles.
constexpr std::size_t kMaxMeshParts = 2'000'000;

/// Reads a file's bytes: STL (ASCII or binary) and PLY (ASCII, little- or big-endian; polygons are
/// cut into triangles). `name` stands for the file in messages. Throws std::runtime_error naming
/// file, line (of text) or byte (of binary data), and what is expected there.
[[nodiscard]] Mesh parse_mesh(std::string_view bytes, const std::string& name);

}  // namespace dtact::perceive
