#include "clients/geometry/mesh_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "clients/geometry/mesh_reader.hpp"

namespace dtact::perceive {
namespace {

bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\v' || c == '\f';
}

bool is_finite(const std::array<double, 3>& vector) {
  return std::ranges::all_of(vector, [](double part) { return std::isfinite(part); });
}

}  // namespace

std::string shown(std::string_view word) {
  std::string text(word.substr(0, 40));
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '?';
  }
  return text;
}

void MeshReader::fail(const std::string& sentence) const {
  throw std::runtime_error(binary_ ? fmt::format("{}, byte {}: {}", name_, at_, sentence)
                                   : fmt::format("{}, line {}: {}", name_, line_, sentence));
}

void MeshReader::skip_space() {
  while (at_ < bytes_.size() && is_space(bytes_[at_])) {
    if (bytes_[at_++] == '\n') ++line_;
  }
}

std::string_view MeshReader::word() {
  skip_space();
  const std::size_t from = at_;
  while (at_ < bytes_.size() && !is_space(bytes_[at_])) ++at_;
  return bytes_.substr(from, at_ - from);
}

std::string_view MeshReader::line() {
  const std::size_t from = at_;
  const std::size_t end = bytes_.find('\n', at_);
  if (end == std::string_view::npos) {
    at_ = bytes_.size();
    return bytes_.substr(from);
  }
  at_ = end + 1;
  ++line_;
  std::string_view text = bytes_.substr(from, end - from);
  if (text.ends_with('\r')) text.remove_suffix(1);
  return text;
}

double MeshReader::number() {
  const std::string_view text = word();
  if (text.empty()) fail("the file ends where a number is expected: it is cut off, write it again");
  const char* from = text.data() + (text.starts_with('+') ? 1 : 0);
  const char* to = text.data() + text.size();
  double value = 0;
  const auto [end, error] = std::from_chars(from, to, value);
  if (error != std::errc{} || end != to) {
    fail(fmt::format("expected a number, not \"{}\"", shown(text)));
  }
  return value;
}

void MeshReader::expect(std::string_view expected) {
  const std::string_view found = word();
  if (found == expected) return;
  fail(found.empty()
           ? fmt::format("the file ends where \"{}\" is expected: it is cut off, write it again",
                         expected)
           : fmt::format("expected \"{}\", not \"{}\"", expected, shown(found)));
}

void MeshReader::expect_end(const std::string& last) {
  if (binary_ ? left() == 0 : word().empty()) return;
  fail(binary_ ? fmt::format("{} byte(s) are left after {}: the header's counts are wrong, or they "
                             "are to be taken off",
                             left(), last)
               : fmt::format("more follows after {}: the header's counts are wrong, or it is to be "
                             "taken off",
                             last));
}

void MeshReader::skip(std::size_t count) { (void)take(count); }

std::string_view MeshReader::take(std::size_t count) {
  if (count > left()) fail("the file ends too early: it is cut off, write it again");
  const std::string_view taken = bytes_.substr(at_, count);
  at_ += count;
  return taken;
}

void check_mesh_size(std::uintmax_t bytes, const std::string& name) {
  if (bytes <= kMaxMeshBytes) return;
  throw std::runtime_error(
      fmt::format("{}: larger than {} MiB: simplify the mesh", name, kMaxMeshBytes >> 20U));
}

Mesh parse_mesh(std::string_view bytes, const std::string& name) {
  const auto fail = [&name](const std::string& sentence) {
    throw std::runtime_error(fmt::format("{}: {}", name, sentence));
  };
  check_mesh_size(bytes.size(), name);
  Mesh mesh = bytes.starts_with("ply") ? parse_ply(bytes, name) : parse_stl(bytes, name);
  if (mesh.points.empty()) fail("there are no points in it");
  for (const auto& point : mesh.points) {
    if (!is_finite(point)) fail("a coordinate is not a finite number");
  }
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) {
      if (corner >= mesh.points.size()) {
        fail(fmt::format("a face names point {}, of {}: the file is damaged, write it again",
                         corner, mesh.points.size()));
      }
    }
  }
  if (!mesh.triangles.empty()) {
    mesh.normals.clear();
  } else if (mesh.normals.empty()) {
    fail("neither faces nor normals: save the points with nx, ny and nz, outwards, or a mesh");
  }
  for (const auto& normal : mesh.normals) {
    if (!is_finite(normal)) fail("a normal is not a finite number");
  }
  return mesh;
}

}  // namespace dtact::perceive
