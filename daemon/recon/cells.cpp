#include "daemon/recon/cells.hpp"

#include "daemon/recon/vector_targets.hpp"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "daemon/recon/cells.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
// After foreach_target.h:
#include <hwy/highway.h>

#include <iterator>
#include <numeric>

HWY_BEFORE_NAMESPACE();
namespace dtact::recon::vec::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

void SumCells(const uint8_t* luma, std::ptrdiff_t stride, int cells, uint8_t clipped, int32_t* sum,
              int32_t* upper, int32_t* rough, int64_t& saturated) {
  for (int cell = 0; cell < cells; ++cell) {
    sum[cell] = 0;
    rough[cell] = 0;
    for (int y = 0; y < kCell; y += kRowStep) {
      if (y == kCell / 2) upper[cell] = sum[cell];
      const uint8_t* row = luma + y * stride + cell * kCell;
      for (int x = 0; x < kCell; ++x) {
        sum[cell] += row[x];
        saturated += row[x] >= clipped ? 1 : 0;
        const int step = row[x + (y % 8 == 0 ? kRowStep * stride : 0)] - row[x];
        rough[cell] += step < 0 ? -step : step;
      }
    }
  }
}

#else

/// Saturated pixels of a row of cells, `bytes` wide, one by one: few frames have any.
HWY_NOINLINE void CountSaturated(const uint8_t* luma, std::ptrdiff_t stride, size_t bytes,
                                 uint8_t clipped, int64_t& saturated) {
  for (int y = 0; y < kCell; y += kRowStep) {
    int in_row = 0;
    for (size_t x = 0; x < bytes; ++x) {
      in_row += luma[y * stride + static_cast<std::ptrdiff_t>(x)] >= clipped ? 1 : 0;
    }
    saturated += in_row;
  }
}

/// The number of cells that fit into `d8`.
template <class D8>
HWY_INLINE void SumVector(D8 d8, const uint8_t* luma, std::ptrdiff_t stride, uint8_t clipped,
                          int32_t* sum, int32_t* upper, int32_t* rough, int64_t& saturated) {
  const hn::Repartition<uint64_t, D8> d64;
  constexpr size_t kCells = hn::MaxLanes(D8()) / kCell;
  auto sums = hn::Zero(d64);
  auto uppers = hn::Zero(d64);
  auto steps = hn::Zero(d64);
  auto brightest = hn::Zero(d8);
  auto before = hn::Zero(d8);
  for (int y = 0; y < kCell; y += kRowStep) {
    const auto row = hn::LoadU(d8, luma + y * stride);
    if (y == kCell / 2) uppers = sums;
    sums = hn::Add(sums, hn::SumsOf8(row));
    brightest = hn::Max(brightest, row);
    if (y % 8 == kRowStep) {
      const auto step = hn::Sub(hn::Max(row, before), hn::Min(row, before));
      steps = hn::Add(steps, hn::SumsOf8(step));
    }
    before = row;
  }
  HWY_ALIGN uint64_t halves[2 * kCells];
  const auto store = [&](auto eights, int32_t* out) HWY_ATTR {
    hn::Store(eights, d64, halves);
    for (size_t i = 0; i < kCells; ++i) {
      out[i] = static_cast<int32_t>(halves[2 * i] + halves[2 * i + 1]);
    }
  };
  store(sums, sum);
  store(uppers, upper);
  store(steps, rough);
  const auto bright = hn::Max(brightest, hn::Set(d8, clipped));
  if (HWY_UNLIKELY(!hn::AllFalse(d8, hn::Eq(bright, brightest)))) {
    CountSaturated(luma, stride, hn::MaxLanes(D8()), clipped, saturated);
  }
}

void SumCells(const uint8_t* luma, std::ptrdiff_t stride, int cells, uint8_t clipped, int32_t* sum,
              int32_t* upper, int32_t* rough, int64_t& saturated) {
  const hn::ScalableTag<uint8_t> wide;
  const hn::CappedTag<uint8_t, kCell> narrow;
  constexpr int kWide = static_cast<int>(hn::MaxLanes(wide) / kCell);
  int cell = 0;
  for (; cell + kWide <= cells; cell += kWide) {
    SumVector(wide, luma + std::ptrdiff_t{cell} * kCell, stride, clipped, sum + cell, upper + cell,
              rough + cell, saturated);
  }
  for (; cell < cells; ++cell) {
    SumVector(narrow, luma + std::ptrdiff_t{cell} * kCell, stride, clipped, sum + cell,
              upper + cell, rough + cell, saturated);
  }
}

#endif  // HWY_TARGET == HWY_SCALAR

/// A cell's sum to its mean in Q16.
constexpr int kToQ16 = 9;
static_assert(kCellPixels << kToQ16 == 1 << 16);

using D32 = hn::CappedTag<int32_t, kCellBlock>;
using V32 = hn::VFromD<D32>;

/// Whether |change| is above the limit that counts for the present state.
HWY_INLINE V32 Update(D32 d32, V32 active, V32 change, int32_t on, int32_t off) {
  const V32 limit =
      hn::IfThenElse(hn::Ne(active, hn::Zero(d32)), hn::Set(d32, off), hn::Set(d32, on));
  return hn::VecFromMask(d32, hn::Gt(hn::Abs(change), limit));
}

CellTotals CompareCells(const CellPlanes& p, const ChangeLimits& limits) {
  const D32 d32;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d32));
  V32 grey = hn::Zero(d32);
  V32 change_sum = hn::Zero(d32);
  V32 step = hn::Zero(d32);
  V32 any = hn::Zero(d32);
  for (int i = 0; i < p.rows * p.stride; i += kLanes) {
    const V32 sum = hn::LoadU(d32, p.sum + i);
    const V32 change = hn::Sub(hn::ShiftLeft<kToQ16>(sum), hn::LoadU(d32, p.expected + i));
    hn::StoreU(change, d32, p.change + i);
    const V32 cell =
        Update(d32, hn::LoadU(d32, p.cell + i), change, limits.cell_on, limits.cell_off);
    hn::StoreU(cell, d32, p.cell + i);
    any = hn::Or(any, cell);
    const V32 in_contact = hn::LoadU(d32, p.active + i);
    grey = hn::Add(grey, sum);
    change_sum = hn::Add(change_sum, hn::AndNot(in_contact, hn::ShiftRight<8>(change)));
    const V32 moved = hn::Abs(hn::Sub(sum, hn::LoadU(d32, p.sum_before + i)));
    step = hn::Add(step, hn::AndNot(in_contact, moved));
  }
  for (int row = 0; row < p.window_rows; ++row) {
    for (int i = row * p.stride; i < (row + 1) * p.stride; i += kLanes) {
      const int32_t* const below = p.change + i + p.stride;
      const V32 upper = hn::Add(hn::LoadU(d32, p.change + i), hn::LoadU(d32, p.change + i + 1));
      const V32 lower = hn::Add(hn::LoadU(d32, below), hn::LoadU(d32, below + 1));
      const V32 window =
          Update(d32, hn::LoadU(d32, p.window + i), hn::ShiftRight<2>(hn::Add(upper, lower)),
                 limits.window_on, limits.window_off);
      hn::StoreU(window, d32, p.window + i);
    }
    for (int c = p.window_columns; c < p.stride; ++c) p.window[row * p.stride + c] = 0;
  }
  for (int i = 0; i < p.rows * p.stride; i += kLanes) {
    any = hn::Or(any, hn::LoadU(d32, p.window + i));
  }
  V32 active = hn::Zero(d32);
  const bool none = hn::AllTrue(d32, hn::Eq(any, hn::Zero(d32)));
  for (int i = 0; i < p.rows * p.stride; i += kLanes) {
    V32 now = hn::Zero(d32);
    if (!none) {
      const int32_t* const above = p.window + i - p.stride;
      now = hn::Or(hn::Or(hn::LoadU(d32, p.window + i), hn::LoadU(d32, p.window + i - 1)),
                   hn::Or(hn::LoadU(d32, above), hn::LoadU(d32, above - 1)));
      now = hn::Or(now, hn::LoadU(d32, p.cell + i));
      active = hn::Sub(active, now);
    }
    hn::StoreU(now, d32, p.active + i);
  }
  // A lane's sum fits 32 bits, that of all lanes does not above 16.8 megapixels.
  const auto total = [&](V32 v) HWY_ATTR {
    HWY_ALIGN int32_t lanes[kLanes];
    hn::Store(v, d32, lanes);
    return std::accumulate(std::begin(lanes), std::end(lanes), int64_t{0});
  };
  return {total(grey), total(change_sum), total(step), static_cast<int>(total(active))};
}

}  // namespace dtact::recon::vec::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dtact::recon::vec {

HWY_EXPORT(SumCells);
HWY_EXPORT(CompareCells);

void sum_cells(const std::uint8_t* luma, std::ptrdiff_t stride, int cells, std::uint8_t clipped,
               std::int32_t* sum, std::int32_t* upper, std::int32_t* rough,
               std::int64_t& saturated) noexcept {
  HWY_DYNAMIC_DISPATCH(SumCells)(luma, stride, cells, clipped, sum, upper, rough, saturated);
}

CellTotals compare_cells(const CellPlanes& planes, const ChangeLimits& limits) noexcept {
  return HWY_DYNAMIC_DISPATCH(CompareCells)(planes, limits);
}

}  // namespace dtact::recon::vec
#endif  // HWY_ONCE
