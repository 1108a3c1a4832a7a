#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "clients/geometry/mesh_reader.hpp"

// PLY: http://paulbourke.net/dataformats/ply/

namespace dtact::perceive {
namespace {

enum class Type : std::uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct Named {
  std::string_view name;
  Type type;
};
constexpr std::array kTypes{
    Named{"char", Type::int8},      Named{"int8", Type::int8},       Named{"uchar", Type::uint8},
    Named{"uint8", Type::uint8},    Named{"short", Type::int16},     Named{"int16", Type::int16},
    Named{"ushort", Type::uint16},  Named{"uint16", Type::uint16},   Named{"int", Type::int32},
    Named{"int32", Type::int32},    Named{"uint", Type::uint32},     Named{"uint32", Type::uint32},
    Named{"float", Type::float32},  Named{"float32", Type::float32}, Named{"double", Type::float64},
    Named{"float64", Type::float64}};

enum class Format : std::uint8_t { ascii, little, big };

struct Property {
  std::string_view name;
  Type type = Type::float32;
  std::optional<Type> count;  ///< Type of a list's length.
};
struct Element {
  std::string_view name;
  std::size_t count = 0;
  std::vector<Property> properties;
};
struct Header {
  Format format = Format::ascii;
  std::vector<Element> elements;
};

Type type_of(std::string_view word, const MeshReader& reader) {
  const auto* found = std::ranges::find(kTypes, word, &Named::name);
  if (found == kTypes.end()) {
    reader.fail("expected a type of PLY: char, uchar, short, ushort, int, uint, float or double");
  }
  return found->type;
}

std::size_t whole(double value, double most, const char* what, const MeshReader& reader) {
  if (!(value >= 0 && value <= most && value == std::floor(value))) {
    reader.fail(fmt::format("{} has to be a whole number from 0 to {:.0f}", what, most));
  }
  return static_cast<std::size_t>(value);
}

Format format_of(std::string_view word, const MeshReader& reader) {
  if (word == "ascii") return Format::ascii;
  if (word == "binary_little_endian") return Format::little;
  if (word == "binary_big_endian") return Format::big;
  reader.fail("expected the format ascii, binary_little_endian or binary_big_endian");
}

Header parse_header(MeshReader& reader) {
  reader.expect("ply");
  reader.expect("format");
  Header header;
  header.format = format_of(reader.word(), reader);
  reader.expect("1.0");
  for (;;) {
    const std::string_view word = reader.word();
    if (word == "end_header") break;
    if (word == "comment" || word == "obj_info") {
      (void)reader.line();
    } else if (word == "element") {
      const std::string_view name = reader.word();
      // Of two, one could have normals and the other none.
      if (name == "vertex" && std::ranges::count(header.elements, name, &Element::name) > 0) {
        reader.fail("a second element \"vertex\": write all vertices as one");
      }
      const std::size_t count = whole(reader.number(), static_cast<double>(kMaxMeshParts),
                                      "an element's count (more: simplify the mesh)", reader);
      header.elements.push_back({name, count, {}});
    } else if (word == "property" && !header.elements.empty()) {
      Property property;
      std::string_view type = reader.word();
      if (type == "list") {
        property.count = type_of(reader.word(), reader);
        type = reader.word();
      }
      property.type = type_of(type, reader);
      property.name = reader.word();
      header.elements.back().properties.push_back(property);
    } else {
      reader.fail("expected element, property, comment or end_header");
    }
  }
  (void)reader.line();
  if (header.format != Format::ascii) reader.begin_binary();
  return header;
}

double value_of(Type type, Format format, MeshReader& reader) {
  if (format == Format::ascii) return reader.number();
  const bool big = format == Format::big;
  switch (type) {
    case Type::int8:
      return reader.binary<std::int8_t>(big);
    case Type::uint8:
      return reader.binary<std::uint8_t>(big);
    case Type::int16:
      return reader.binary<std::int16_t>(big);
    case Type::uint16:
      return reader.binary<std::uint16_t>(big);
    case Type::int32:
      return reader.binary<std::int32_t>(big);
    case Type::uint32:
      return reader.binary<std::uint32_t>(big);
    case Type::float32:
      return static_cast<double>(reader.binary<float>(big));
    case Type::float64:
      return reader.binary<double>(big);
  }
  return 0;
}

/// Where a vertex's property goes: 0 to 2 the point, 3 to 5 the normal.
std::optional<std::size_t> slot_of(std::string_view name) {
  constexpr std::array<std::string_view, 6> kNames{"x", "y", "z", "nx", "ny", "nz"};
  const auto* found = std::ranges::find(kNames, name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<std::size_t>(found - kNames.begin());
}

class Body {
 public:
  Body(MeshReader& reader, Format format) : reader_(reader), format_(format) {}

  void read(const Element& element, Mesh& mesh) {
    check_size(element);
    if (element.name == "vertex") return vertices(element, mesh);
    for (std::size_t i = 0; i < element.count; ++i) {
      for (const Property& property : element.properties) {
        const bool corners = element.name == "face" && property.count &&
                             (property.name == "vertex_indices" || property.name == "vertex_index");
        if (corners) {
          face(property, mesh);
        } else {
          pass(property);
        }
      }
    }
  }

 private:
  /// Before anything is reserved: every property takes a byte of the file at least.
  void check_size(const Element& element) const {
    if (element.properties.empty() && element.count > 0) {
      reader_.fail(fmt::format("the {} have no properties", kind(element)));
    }
    if (element.count > reader_.left() / std::max<std::size_t>(1, element.properties.size())) {
      reader_.fail(
          fmt::format("the file ends before its {}: it is cut off, write it again", kind(element)));
    }
  }
  [[nodiscard]] static std::string_view kind(const Element& element) {
    if (element.name == "vertex") return "vertices";
    return element.name == "face" ? "faces" : "further elements";
  }

  void vertices(const Element& element, Mesh& mesh) {
    unsigned slots = 0;
    for (const Property& property : element.properties) {
      if (const auto slot = slot_of(property.name); slot && !property.count) slots |= 1U << *slot;
    }
    constexpr unsigned kPoint = 0b000111;
    constexpr unsigned kBoth = 0b111111;
    if ((slots & kPoint) != kPoint) reader_.fail("the vertices lack x, y or z");
    mesh.points.reserve(element.count);
    for (std::size_t i = 0; i < element.count; ++i) {
      std::array<double, 6> values{};
      for (const Property& property : element.properties) {
        const auto slot = property.count ? std::nullopt : slot_of(property.name);
        if (slot) {
          values.at(*slot) = value_of(property.type, format_, reader_);
        } else {
          pass(property);
        }
      }
      mesh.points.push_back({values[0], values[1], values[2]});
      if (slots == kBoth) mesh.normals.push_back({values[3], values[4], values[5]});
    }
  }

  /// A fan: any polygon that is convex.
  void face(const Property& property, Mesh& mesh) {
    const std::size_t corners = length(property);
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t i = 0; i < corners; ++i) {
      const auto corner = static_cast<std::uint32_t>(
          whole(value_of(property.type, format_, reader_), UINT32_MAX, "a face's corner", reader_));
      triangle.at(std::min<std::size_t>(i, 2)) = corner;
      if (i < 2) continue;
      if (mesh.triangles.size() == kMaxMeshParts) {
        reader_.fail(fmt::format("more than {} triangles: simplify the mesh", kMaxMeshParts));
      }
      mesh.triangles.push_back(triangle);
      triangle[1] = corner;
    }
  }

  void pass(const Property& property) {
    const std::size_t values = length(property);
    for (std::size_t i = 0; i < values; ++i) (void)value_of(property.type, format_, reader_);
  }

  /// Number of values: a list's length, else 1.
  std::size_t length(const Property& property) {
    if (!property.count) return 1;
    return whole(value_of(*property.count, format_, reader_), static_cast<double>(reader_.left()),
                 "a list's length (as far as the file goes)", reader_);
  }

  MeshReader& reader_;
  Format format_;
};

}  // namespace

Mesh parse_ply(std::string_view bytes, const std::string& name) {
  MeshReader reader(bytes, name);
  const Header header = parse_header(reader);
  Mesh mesh;
  Body body(reader, header.format);
  for (const Element& element : header.elements) body.read(element, mesh);
  reader.expect_end("the last element");
  return mesh;
}

}  // namespace dtact::perceive
