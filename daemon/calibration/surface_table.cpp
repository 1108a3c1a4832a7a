#include "daemon/calibration/surface_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "daemon/recon/surface.hpp"

namespace dtact::calibration {
namespace {

using Kind = recon::Surface::Kind;
using Limits = recon::SurfaceLimits;

constexpr double kUmPerMm = 1000;

std::string format_shape(const recon::Surface& surface) {
  if (surface.kind == Kind::sphere) {
    return fmt::format("shape = \"sphere\"\nradius_mm = {}\n", surface.radius_mm);
  }
  if (surface.kind == Kind::cylinder) {
    return fmt::format(
        "shape = \"cylinder\"\nradius_mm = {}\n"
        "axis_deg = {}  # from the map's x towards its y\n",
        surface.radius_mm, surface.axis_deg);
  }
  const recon::SurfaceHeights& heights = *surface.heights;
  std::string text = fmt::format(
      "shape = \"heights\"\nspacing_mm = {}  # from node to node\n"
      "heights_mm = [  # of the nodes, as the map's rows; the grid's middle is the map's\n",
      heights.spacing_mm);
  const auto width = static_cast<std::size_t>(heights.width);
  for (std::size_t from = 0; from < heights.z_um.size(); from += width) {
    std::vector<double> row;
    for (std::size_t i = from; i < from + width; ++i) row.push_back(heights.z_um[i] / kUmPerMm);
    text += fmt::format("  [{}],\n", fmt::join(row, ", "));
  }
  return text + "]\n";
}

/// Of the grid's middle, as the surface's bicubic convolution has it: where a side's number of
/// nodes is even it lies between two.
double middle_of(const std::vector<std::vector<double>>& rows) {
  const auto middle = [](std::size_t nodes, auto at) {
    const std::size_t half = nodes / 2;
    if (nodes % 2 == 1) return at(half);
    return (9 * (at(half - 1) + at(half)) - at(half - 2) - at(half + 1)) / 16;
  };
  return middle(rows.size(), [&](std::size_t row) {
    return middle(rows[row].size(), [&](std::size_t column) { return rows[row][column]; });
  });
}

void check_heights(const tomlfile::KeyReader& reader, const std::vector<std::vector<double>>& rows,
                   const recon::Surface& surface, double spacing_mm) {
  const auto fail = [&](std::size_t row, std::size_t column, const std::string& what) {
    reader.fail("heights_mm", fmt::format("row {}, entry {} is {} mm{}", row + 1, column + 1,
                                          rows[row][column], what));
  };
  for (std::size_t row = 0; row < rows.size(); ++row) {
    for (std::size_t column = 0; column < rows[row].size(); ++column) {
      const double here = rows[row][column];
      if (here <= -surface.gel_mm) {
        fail(row, column,
             fmt::format(", behind the gel's flat back; expected more than {}", -surface.gel_mm));
      }
      const auto compare = [&](double before, const char* where) {
        if (std::abs(here - before) <= Limits::kMostSlope * spacing_mm) return;
        fail(row, column,
             fmt::format(", too steep beside the {} mm {}; expected at most {} times spacing_mm "
                         "from one node to the next",
                         before, where, Limits::kMostSlope));
      };
      if (column > 0) compare(rows[row][column - 1], "to the left");
      if (row > 0) compare(rows[row - 1][column], "above");
    }
  }
  constexpr double kMostMiddleMm = 0.05;
  if (const double middle = middle_of(rows); std::abs(middle) > kMostMiddleMm) {
    reader.fail("heights_mm",
                fmt::format("the middle is {:.3f} mm high; expected 0, to {} mm: heights are from "
                            "where the camera's axis leaves the gel, so take this off all of them",
                            middle, kMostMiddleMm));
  }
}

std::shared_ptr<const recon::SurfaceHeights> read_heights(tomlfile::KeyReader& reader,
                                                          const recon::Surface& surface) {
  recon::SurfaceHeights heights;
  heights.spacing_mm = reader.number("spacing_mm", Limits::kLeastSpacingMm, Limits::kMostSpacingMm);
  const auto rows = reader.rows("heights_mm", -Limits::kMostHeightMm, Limits::kMostHeightMm);
  for (const std::size_t nodes : {rows.size(), rows.front().size()}) {
    if (nodes >= Limits::kLeastNodes && nodes <= Limits::kMostNodes) continue;
    reader.fail("heights_mm",
                fmt::format("{} rows of {} are not allowed; expected {} to {} of each", rows.size(),
                            rows.front().size(), Limits::kLeastNodes, Limits::kMostNodes));
  }
  check_heights(reader, rows, surface, heights.spacing_mm);
  heights.width = static_cast<int>(rows.front().size());
  heights.height = static_cast<int>(rows.size());
  for (const auto& row : rows) {
    for (const double mm : row) {
      heights.z_um.push_back(static_cast<std::int32_t>(std::lround(mm * kUmPerMm)));
    }
  }
  return std::make_shared<const recon::SurfaceHeights>(std::move(heights));
}

}  // namespace

std::string format_surface(const recon::Surface& surface) {
  if (surface.kind == Kind::plane) return {};
  return fmt::format(
      "{}air_mm = {}  # from the camera's pinhole to the gel's flat back\n"
      "gel_mm = {}  # from there to the surface\n"
      "refraction = {}  # of the gel\n",
      format_shape(surface), surface.air_mm, surface.gel_mm, surface.refraction);
}

recon::Surface read_surface(tomlfile::KeyReader reader) {
  recon::Surface surface;
  if (reader.keys().empty()) return surface;
  const std::string shape = reader.text("shape");
  if (shape == "sphere") {
    surface.kind = Kind::sphere;
  } else if (shape == "cylinder") {
    surface.kind = Kind::cylinder;
  } else if (shape == "heights") {
    surface.kind = Kind::height_map;
  } else {
    reader.fail("shape", "\"" + shape +
                             "\" is not allowed; expected \"sphere\", \"cylinder\" or "
                             "\"heights\"");
  }
  const bool heights = surface.kind == Kind::height_map;
  if (!heights) {
    surface.radius_mm = reader.number("radius_mm", Limits::kLeastRadiusMm, Limits::kMostRadiusMm);
  }
  if (surface.kind == Kind::cylinder) surface.axis_deg = reader.number("axis_deg", -180, 180);
  surface.air_mm = reader.number("air_mm", Limits::kLeastDistanceMm, Limits::kMostDistanceMm);
  surface.gel_mm = reader.number("gel_mm", Limits::kLeastDistanceMm, Limits::kMostDistanceMm);
  surface.refraction = reader.number("refraction", 1, Limits::kMostRefraction);
  if (heights) surface.heights = read_heights(reader, surface);
  reader.finish();
  return surface;
}

}  // namespace dtact::calibration
