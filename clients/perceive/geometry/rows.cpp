#include "clients/perceive/geometry/rows.hpp"

#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clients/perceive/geometry/rows.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
// After foreach_target.h:
#include <hwy/highway.h>

// Plain loops: the compiler makes vector code of them, once for each of Highway's targets.
HWY_BEFORE_NAMESPACE();
namespace dtact::perceive::HWY_NAMESPACE {

HWY_ATTR void ToMetres(const std::int16_t* HWY_RESTRICT values, std::size_t count, int untrusted,
                       float scale, float* HWY_RESTRICT out) {
  for (std::size_t i = 0; i < count; ++i) {
    const float metres = static_cast<float>(values[i]) * scale;
    out[i] = values[i] == untrusted ? std::numeric_limits<float>::quiet_NaN() : metres;
  }
}

HWY_ATTR int CountHoles(const float* values, int count) {
  int holes = 0;
  for (int i = 0; i < count; ++i) holes += static_cast<int>(values[i] != values[i]);
  return holes;
}

HWY_ATTR void Press(const float* HWY_RESTRICT point, const float* HWY_RESTRICT normal,
                    const float* HWY_RESTRICT depth, int count, float* HWY_RESTRICT out) {
  for (int i = 0; i < count; ++i) out[i] = point[i] - depth[i] * normal[i];
}

HWY_ATTR void Flat(const float* HWY_RESTRICT depth, std::ptrdiff_t left, std::ptrdiff_t right,
                   std::ptrdiff_t above, std::ptrdiff_t below, int count, float per_column,
                   float per_row, float* HWY_RESTRICT nx, float* HWY_RESTRICT ny,
                   float* HWY_RESTRICT nz) {
  for (int i = 0; i < count; ++i) {
    const float gx = (depth[i + right] - depth[i + left]) * per_column;
    const float gy = (depth[i + below] - depth[i + above]) * per_row;
    const float scale = 1.0F / std::sqrt(1.0F + gx * gx + gy * gy) + 0.0F * depth[i];
    nx[i] = gx * scale;
    ny[i] = gy * scale;
    nz[i] = scale;
  }
}

HWY_ATTR void Curved(const float* HWY_RESTRICT x, std::size_t size, std::ptrdiff_t left,
                     std::ptrdiff_t right, std::ptrdiff_t above, std::ptrdiff_t below, int count,
                     float* HWY_RESTRICT nx, float* HWY_RESTRICT ny, float* HWY_RESTRICT nz) {
  const float* y = x + size;
  const float* z = y + size;
  for (int i = 0; i < count; ++i) {
    const float ux = x[i + right] - x[i + left];
    const float uy = y[i + right] - y[i + left];
    const float uz = z[i + right] - z[i + left];
    const float vx = x[i + below] - x[i + above];
    const float vy = y[i + below] - y[i + above];
    const float vz = z[i + below] - z[i + above];
    const float cx = uy * vz - uz * vy;
    const float cy = uz * vx - ux * vz;
    const float cz = ux * vy - uy * vx;
    const float scale = 1.0F / std::sqrt(cx * cx + cy * cy + cz * cz) + 0.0F * z[i];
    nx[i] = cx * scale;
    ny[i] = cy * scale;
    nz[i] = cz * scale;
  }
}

}  // namespace dtact::perceive::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dtact::perceive {

HWY_EXPORT(ToMetres);
HWY_EXPORT(CountHoles);
HWY_EXPORT(Press);
HWY_EXPORT(Flat);
HWY_EXPORT(Curved);

void to_metres(const std::int16_t* values, std::size_t count, int untrusted, float scale,
               float* out) noexcept {
  HWY_DYNAMIC_DISPATCH(ToMetres)(values, count, untrusted, scale, out);
}

int count_holes(const float* values, int count) noexcept {
  return HWY_DYNAMIC_DISPATCH(CountHoles)(values, count);
}

void press(const float* point, const float* normal, const float* depth, int count,
           float* out) noexcept {
  HWY_DYNAMIC_DISPATCH(Press)(point, normal, depth, count, out);
}

void flat_normals(const float* depth, std::ptrdiff_t left, std::ptrdiff_t right,
                  std::ptrdiff_t above, std::ptrdiff_t below, int count, float per_column,
                  float per_row, float* nx, float* ny, float* nz) noexcept {
  HWY_DYNAMIC_DISPATCH(Flat)
  (depth, left, right, above, below, count, per_column, per_row, nx, ny, nz);
}

void curved_normals(const float* x, std::size_t size, std::ptrdiff_t left, std::ptrdiff_t right,
                    std::ptrdiff_t above, std::ptrdiff_t below, int count, float* nx, float* ny,
                    float* nz) noexcept {
  HWY_DYNAMIC_DISPATCH(Curved)(x, size, left, right, above, below, count, nx, ny, nz);
}

}  // namespace dtact::perceive
#endif  // HWY_ONCE
