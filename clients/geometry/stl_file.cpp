#include <fmt/format.h>

#include "clients/geometry/mesh_reader.hpp"

// STL: https://en.wikipedia.org/wiki/STL_(file_format)

namespace dtact::perceive {
namespace {

constexpr std::size_t kHeader = 80;
constexpr std::size_t kTriangle = 50;

/// The corners' winding says what is outside; the normal that is written is often wrong or 0.
void add_triangle(const std::array<std::array<double, 3>, 3>& corners, Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), corners.begin(), corners.end());
  mesh.triangles.push_back({first, first + 1, first + 2});
}

void check_count(std::size_t triangles, const MeshReader& reader) {
  if (triangles <= kMaxMeshParts) return;
  reader.fail(fmt::format("more than {} triangles: simplify the mesh", kMaxMeshParts));
}

/// The facets of one solid, after its first line up to its last.
void read_solid(MeshReader& reader, Mesh& mesh) {
  std::array<std::array<double, 3>, 3> corners{};
  for (;;) {
    const std::string_view word = reader.word();
    if (word == "endsolid") {
      (void)reader.line();
      return;
    }
    if (word != "facet") {
      reader.fail("expected \"facet\" or \"endsolid\": not an STL file, or it is cut off");
    }
    check_count(mesh.triangles.size() + 1, reader);
    reader.expect("normal");
    for (int i = 0; i < 3; ++i) (void)reader.number();
    reader.expect("outer");
    reader.expect("loop");
    for (auto& corner : corners) {
      reader.expect("vertex");
      for (double& part : corner) part = reader.number();
    }
    reader.expect("endloop");
    reader.expect("endfacet");
    add_triangle(corners, mesh);
  }
}

/// One solid or several, which together are the shape.
Mesh parse_text(MeshReader& reader) {
  Mesh mesh;
  for (std::string_view word = reader.word(); !word.empty(); word = reader.word()) {
    if (word != "solid") {
      reader.fail(
          fmt::format("after \"endsolid\" expected another \"solid\" or the file's end, not \"{}\"",
                      shown(word)));
    }
    (void)reader.line();  // its name
    read_solid(reader, mesh);
  }
  return mesh;
}

Mesh parse_binary(MeshReader& reader, std::size_t triangles) {
  Mesh mesh;
  check_count(triangles, reader);
  mesh.points.reserve(3 * triangles);
  mesh.triangles.reserve(triangles);
  std::array<std::array<double, 3>, 3> corners{};
  for (std::size_t i = 0; i < triangles; ++i) {
    reader.skip(3 * sizeof(float));
    for (auto& corner : corners) {
      for (double& part : corner) part = static_cast<double>(reader.binary<float>(false));
    }
    reader.skip(sizeof(std::uint16_t));
    add_triangle(corners, mesh);
  }
  return mesh;
}

}  // namespace

Mesh parse_stl(std::string_view bytes, const std::string& name) {
  MeshReader reader(bytes, name);
  // The size decides: the header of a binary file may begin with "solid", too.
  if (bytes.size() >= kHeader + sizeof(std::uint32_t)) {
    MeshReader binary(bytes, name);
    binary.begin_binary();
    binary.skip(kHeader);
    const std::size_t triangles = binary.binary<std::uint32_t>(false);
    const std::size_t expected = kHeader + sizeof(std::uint32_t) + kTriangle * triangles;
    if (bytes.size() == expected) return parse_binary(binary, triangles);
    // Text has no NUL, which ends the count of fewer than 16 million triangles.
    const bool text = bytes.starts_with("solid") && bytes[kHeader + 3] != '\0';
    if (!text) {
      binary.fail(fmt::format(
          "neither PLY nor STL, or {}: {} triangles take {} bytes, there are {}",
          bytes.size() < expected ? "cut off"
                                  : fmt::format("followed by {} byte(s) too many, to be taken off",
                                                bytes.size() - expected),
          triangles, expected, bytes.size()));
    }
  } else if (!bytes.starts_with("solid")) {
    reader.fail(
        "neither PLY nor STL: it begins with neither \"ply\" nor \"solid\", and is too "
        "short for binary STL");
  }
  return parse_text(reader);
}

}  // namespace dtact::perceive
