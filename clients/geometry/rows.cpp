#include "clients/geometry/rows.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace dtact::perceive {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// NaN for an untrusted value.
float trusted(std::int16_t value, DepthUnit unit) {
  return value == unit.untrusted ? kNaN : static_cast<float>(value);
}

/// Calls some(begin, end, left, right) for runs of pixels whose neighbours are `left` and `right`
/// away: one at a time at the row's ends, all the others at once.
template <typename Some>
void with_neighbours(const RowPart& part, Some some) {
  const int reach = part.reach;
  const int first = std::clamp(reach, part.begin, part.end);
  const int last = std::clamp(part.width - reach, first, part.end);
  const auto at_end = [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      some(i, i + 1, std::max(-i, -reach), std::min(part.width - 1 - i, reach));
    }
  };
  at_end(part.begin, first);
  some(first, last, -reach, reach);
  at_end(last, part.end);
}

}  // namespace

std::uint64_t pressed_tiles(const std::int16_t* values, int width, int tile) noexcept {
  std::uint64_t pressed = 0;
  for (int from = 0, number = 0; from < width; from += tile, ++number) {
    const int end = std::min(width, from + tile);
    int any = 0;
    for (int i = from; i < end; ++i) any |= values[i];
    pressed |= std::uint64_t{any != 0} << static_cast<unsigned>(number);
  }
  return pressed;
}

int count_holes(const float* values, int count) noexcept {
  int holes = 0;
  for (int i = 0; i < count; ++i) holes += values[i] != values[i] ? 1 : 0;
  return holes;
}

float largest(const float* values, std::size_t count) noexcept {
  // The bits of positive numbers are in the numbers' order.
  constexpr std::int32_t kInfinity = 0x7F800000;
  std::int32_t most = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::int32_t size = std::bit_cast<std::int32_t>(values[i]) & 0x7FFFFFFF;
    most = size > most && size <= kInfinity ? size : most;
  }
  return std::bit_cast<float>(most);
}

void quantise(const float* __restrict values, std::size_t count, float per_unit,
              std::int16_t* __restrict out) noexcept {
  constexpr float kMax = 32767;
  constexpr float kWhole = 12582912;  // 1.5 · 2²³, whose floats lie 1 apart: a sum is rounded
  for (std::size_t i = 0; i < count; ++i) {
    const float units = values[i] * per_unit;
    const float low = units > -kMax ? units : -kMax;  // of NaN too
    const float whole = ((low < kMax ? low : kMax) + kWhole) - kWhole;
    out[i] = static_cast<std::int16_t>(units != units ? -32768 : static_cast<int>(whole));
  }
}

void press(const float* __restrict point, const float* __restrict ray,
           const std::int16_t* __restrict depth, DepthUnit unit, int count,
           float* __restrict out) noexcept {
  for (int i = 0; i < count; ++i) {
    out[i] = point[i] - trusted(depth[i], unit) * unit.metres * ray[i];
  }
}

void flat_points(const std::int16_t* __restrict depth, DepthUnit unit, const FlatRow& row,
                 const RowPart& part, const RowPoints& out) noexcept {
  float* __restrict x = out.x;
  float* __restrict y = out.y;
  float* __restrict z = out.z;
  float* __restrict nx = out.nx;
  float* __restrict ny = out.ny;
  float* __restrict nz = out.nz;
  const std::ptrdiff_t rows = (part.below - part.above) / part.width;
  const float per_row = unit.metres / (static_cast<float>(rows) * row.step);
  const FlatRow at = row;
  const float lean_y = at.per_metre * (at.y - at.foot_y);
  with_neighbours(part, [=](int begin, int end, int left, int right) {
    const float per_column = unit.metres / (static_cast<float>(right - left) * at.step);
    for (int i = begin; i < end; ++i) {
      const std::int16_t* here = depth + i;
      const float down = trusted(*here, unit) * unit.metres;
      const float gx = (trusted(here[right], unit) - trusted(here[left], unit)) * per_column;
      const float gy =
          (trusted(here[part.below], unit) - trusted(here[part.above], unit)) * per_row;
      const float seen = at.x + at.step * static_cast<float>(i);
      const float lean_x = at.per_metre * (seen - at.foot_x);
      // NaN where there is no depth here.
      const float up = 1 - at.per_metre * down - lean_x * gx - lean_y * gy;
      const float scale = 1 / std::sqrt(up * up + gx * gx + gy * gy) + 0 * down;
      x[i] = seen - lean_x * down;
      y[i] = at.y - lean_y * down;
      z[i] = -down;
      nx[i] = gx * scale;
      ny[i] = gy * scale;
      nz[i] = up * scale;
    }
  });
}

void curved_normals(const float* __restrict x, std::size_t apart, const RowPart& part,
                    float* __restrict nx, float* __restrict ny, float* __restrict nz) noexcept {
  const float* y = x + apart;
  const float* z = y + apart;
  with_neighbours(part, [=](int begin, int end, int left, int right) {
    for (int i = begin; i < end; ++i) {
      const float ux = x[i + right] - x[i + left];
      const float uy = y[i + right] - y[i + left];
      const float uz = z[i + right] - z[i + left];
      const float vx = x[i + part.below] - x[i + part.above];
      const float vy = y[i + part.below] - y[i + part.above];
      const float vz = z[i + part.below] - z[i + part.above];
      const float cx = uy * vz - uz * vy;
      const float cy = uz * vx - ux * vz;
      const float cz = ux * vy - uy * vx;
      const float square = cx * cx + cy * cy + cz * cz;
      // NaN where there is no point here.
      const float scale = (square > 0 ? 1 / std::sqrt(square) : kNaN) + 0 * z[i];
      nx[i] = cx * scale;
      ny[i] = cy * scale;
      nz[i] = cz * scale;
    }
  });
}

}  // namespace dtact::perceive
