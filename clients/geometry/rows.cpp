#include "clients/geometry/rows.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clients/geometry/rows.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
// After foreach_target.h:
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dtact::perceive::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// 1/√q of q > 0. The first guess is wrong by 3.5 % at most (Lomont, "Fast inverse square root",
/// 2003); each step leaves 1.5 times the square of the error before.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V InverseRoot(D d, V q) {
  const hn::RebindToSigned<D> bits;
  const V half = hn::Mul(hn::Set(d, 0.5F), q);
  const V one_and_half = hn::Set(d, 1.5F);
  V y = hn::BitCast(d, hn::Sub(hn::Set(bits, 0x5F375A86), hn::ShiftRight<1>(hn::BitCast(bits, q))));
  for (int step = 0; step < 3; ++step) {
    y = hn::Mul(y, hn::Sub(one_and_half, hn::Mul(hn::Mul(half, y), y)));
  }
  return y;
}

/// Values as floats, which hold them exactly; NaN for `none`.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V Read(D d, const std::int16_t* values, V none) {
  const hn::Rebind<std::int16_t, D> narrow;
  const hn::RebindToSigned<D> wide;
  const V value = hn::ConvertTo(d, hn::PromoteTo(wide, hn::LoadU(narrow, values)));
  return hn::IfThenElse(hn::Eq(value, none), hn::NaN(d), value);
}

/// Calls some(d, i) for as many pixels of [begin, end) at a time as there are lanes. The last ones
/// are made again with some of those before rather than one by one.
template <typename Index, typename Some>
HWY_INLINE void InVectors(Index begin, Index end, Some some) {
  const hn::ScalableTag<float> d;
  const auto lanes = static_cast<Index>(hn::Lanes(d));
  if (end - begin < lanes) {
    for (Index i = begin; i < end; ++i) some(hn::CappedTag<float, 1>(), i);
    return;
  }
  Index i = begin;
  for (; i + lanes <= end; i += lanes) some(d, i);
  if (i < end) some(d, end - lanes);
}

/// The same with how far a pixel's neighbours in the row lie.
template <typename Some>
HWY_INLINE void WithNeighbours(const RowPart& part, Some some) {
  const int reach = part.reach;
  const int first = std::clamp(reach, part.begin, part.end);
  const int last = std::clamp(part.width - reach, first, part.end);
  const auto at_end = [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      some(hn::CappedTag<float, 1>(), i, std::max(-i, -reach), std::min(part.width - 1 - i, reach));
    }
  };
  at_end(part.begin, first);
  InVectors(first, last, [&](auto d, int i) HWY_ATTR { some(d, i, -reach, reach); });
  at_end(last, part.end);
}

std::uint64_t TouchedTiles(const std::int16_t* HWY_RESTRICT values, int width, int tile) {
  const hn::CappedTag<std::int16_t, kTilePixels> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  std::uint64_t touched = 0;
  std::uint64_t bit = 1;
  for (int from = 0; from < width; from += tile, bit <<= 1U) {
    const int end = std::min(width, from + tile);
    auto any = hn::Zero(d);
    int i = from;
    for (; i + lanes <= end; i += lanes) any = hn::Or(any, hn::LoadU(d, values + i));
    int rest = 0;
    for (; i < end; ++i) rest |= values[i];
    const bool zero = rest == 0 && hn::AllTrue(d, hn::Eq(any, hn::Zero(d)));
    touched |= zero ? 0 : bit;
  }
  return touched;
}

int CountHoles(const float* values, int count) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  std::size_t holes = 0;
  int i = 0;
  for (; i + lanes <= count; i += lanes) {
    holes += hn::CountTrue(d, hn::IsNaN(hn::LoadU(d, values + i)));
  }
  for (; i < count; ++i) holes += values[i] != values[i] ? 1 : 0;
  return static_cast<int>(holes);
}

float Largest(const float* values, std::size_t count) {
  const hn::ScalableTag<float> d;
  const std::size_t lanes = hn::Lanes(d);
  auto found = hn::Zero(d);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const auto size = hn::Abs(hn::LoadU(d, values + i));
    found = hn::IfThenElse(hn::Gt(size, found), size, found);  // false for NaN
  }
  float most = hn::GetLane(hn::MaxOfLanes(d, found));
  for (; i < count; ++i) {
    if (std::abs(values[i]) > most) most = std::abs(values[i]);
  }
  return most;
}

void Quantise(const float* HWY_RESTRICT values, std::size_t count, float per_unit,
              std::int16_t* HWY_RESTRICT out) {
  InVectors(std::size_t{0}, count, [&](auto d, std::size_t i) HWY_ATTR {
    const hn::RebindToSigned<decltype(d)> wide;
    const hn::Rebind<std::int16_t, decltype(d)> narrow;
    const auto most = hn::Set(d, 32767.0F);
    const auto value = hn::LoadU(d, values + i);
    const auto none = hn::RebindMask(wide, hn::IsNaN(value));
    const auto units = hn::Mul(value, hn::Set(d, per_unit));
    const auto whole = hn::NearestInt(hn::Min(hn::Max(units, hn::Neg(most)), most));
    hn::StoreU(hn::DemoteTo(narrow, hn::IfThenElse(none, hn::Set(wide, -32768), whole)), narrow,
               out + i);
  });
}

void Press(const float* HWY_RESTRICT point, const float* HWY_RESTRICT normal,
           const std::int16_t* HWY_RESTRICT depth, DepthUnit unit, int count,
           float* HWY_RESTRICT out) {
  InVectors(0, count, [&](auto d, int i) HWY_ATTR {
    const auto value = Read(d, depth + i, hn::Set(d, static_cast<float>(unit.untrusted)));
    const auto metres = hn::Mul(value, hn::Set(d, unit.metres));
    hn::StoreU(hn::Sub(hn::LoadU(d, point + i), hn::Mul(metres, hn::LoadU(d, normal + i))), d,
               out + i);
  });
}

void Flat(const std::int16_t* HWY_RESTRICT depth, DepthUnit unit, float px_metres,
          const RowPart& part, float* HWY_RESTRICT z, float* HWY_RESTRICT nx,
          float* HWY_RESTRICT ny, float* HWY_RESTRICT nz) {
  const std::ptrdiff_t rows = (part.below - part.above) / part.width;
  const float per_row = unit.metres / (static_cast<float>(rows) * px_metres);
  WithNeighbours(part, [&](auto d, int i, int left, int right) HWY_ATTR {
    const float per_column = unit.metres / (static_cast<float>(right - left) * px_metres);
    const std::int16_t* at = depth + i;
    const auto none = hn::Set(d, static_cast<float>(unit.untrusted));
    const auto here = Read(d, at, none);
    const auto gx = hn::Mul(hn::Sub(Read(d, at + right, none), Read(d, at + left, none)),
                            hn::Set(d, per_column));
    const auto gy = hn::Mul(hn::Sub(Read(d, at + part.below, none), Read(d, at + part.above, none)),
                            hn::Set(d, per_row));
    const auto square = hn::Add(hn::Add(hn::Set(d, 1.0F), hn::Mul(gx, gx)), hn::Mul(gy, gy));
    // NaN where there is no depth here.
    const auto scale = hn::Add(InverseRoot(d, square), hn::Mul(hn::Zero(d), here));
    hn::StoreU(hn::Neg(hn::Mul(here, hn::Set(d, unit.metres))), d, z + i);
    hn::StoreU(hn::Mul(gx, scale), d, nx + i);
    hn::StoreU(hn::Mul(gy, scale), d, ny + i);
    hn::StoreU(scale, d, nz + i);
  });
}

void Curved(const float* HWY_RESTRICT x, std::size_t apart, const RowPart& part,
            float* HWY_RESTRICT nx, float* HWY_RESTRICT ny, float* HWY_RESTRICT nz) {
  WithNeighbours(part, [&](auto d, int i, int left, int right) HWY_ATTR {
    const float* at = x + i;
    const auto between = [&](const float* from, std::ptrdiff_t to, std::ptrdiff_t back) HWY_ATTR {
      return hn::Sub(hn::LoadU(d, from + to), hn::LoadU(d, from + back));
    };
    const auto minor = [](auto a, auto b, auto c, auto e)
                           HWY_ATTR { return hn::Sub(hn::Mul(a, b), hn::Mul(c, e)); };
    const auto ux = between(at, right, left);
    const auto uy = between(at + apart, right, left);
    const auto uz = between(at + 2 * apart, right, left);
    const auto vx = between(at, part.below, part.above);
    const auto vy = between(at + apart, part.below, part.above);
    const auto vz = between(at + 2 * apart, part.below, part.above);
    const auto cx = minor(uy, vz, uz, vy);
    const auto cy = minor(uz, vx, ux, vz);
    const auto cz = minor(ux, vy, uy, vx);
    const auto square = hn::Add(hn::Add(hn::Mul(cx, cx), hn::Mul(cy, cy)), hn::Mul(cz, cz));
    const auto here = hn::LoadU(d, at + 2 * apart);
    const auto there = hn::And(hn::Gt(square, hn::Zero(d)), hn::Eq(here, here));
    const auto scale = hn::IfThenElse(there, InverseRoot(d, square), hn::NaN(d));
    hn::StoreU(hn::Mul(cx, scale), d, nx + i);
    hn::StoreU(hn::Mul(cy, scale), d, ny + i);
    hn::StoreU(hn::Mul(cz, scale), d, nz + i);
  });
}

}  // namespace dtact::perceive::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dtact::perceive {

HWY_EXPORT(TouchedTiles);
HWY_EXPORT(CountHoles);
HWY_EXPORT(Largest);
HWY_EXPORT(Quantise);
HWY_EXPORT(Press);
HWY_EXPORT(Flat);
HWY_EXPORT(Curved);

std::uint64_t touched_tiles(const std::int16_t* values, int width, int tile) noexcept {
  return HWY_DYNAMIC_DISPATCH(TouchedTiles)(values, width, tile);
}

int count_holes(const float* values, int count) noexcept {
  return HWY_DYNAMIC_DISPATCH(CountHoles)(values, count);
}

float largest(const float* values, std::size_t count) noexcept {
  return HWY_DYNAMIC_DISPATCH(Largest)(values, count);
}

void quantise(const float* values, std::size_t count, float per_unit, std::int16_t* out) noexcept {
  HWY_DYNAMIC_DISPATCH(Quantise)(values, count, per_unit, out);
}

void press(const float* point, const float* normal, const std::int16_t* depth, DepthUnit unit,
           int count, float* out) noexcept {
  HWY_DYNAMIC_DISPATCH(Press)(point, normal, depth, unit, count, out);
}

void flat_points(const std::int16_t* depth, DepthUnit unit, float px_metres, const RowPart& part,
                 float* z, float* nx, float* ny, float* nz) noexcept {
  HWY_DYNAMIC_DISPATCH(Flat)(depth, unit, px_metres, part, z, nx, ny, nz);
}

void curved_normals(const float* x, std::size_t apart, const RowPart& part, float* nx, float* ny,
                    float* nz) noexcept {
  HWY_DYNAMIC_DISPATCH(Curved)(x, apart, part, nx, ny, nz);
}

}  // namespace dtact::perceive
#endif  // HWY_ONCE
