#include "daemon/recon/vector_kernels.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "daemon/recon/model.hpp"
#include "daemon/recon/vector_targets.hpp"
#include "daemon/recon/vector_upsample.hpp"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "daemon/recon/vector_kernels.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
// After foreach_target.h:
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
#if HWY_TARGET == HWY_AVX3_DL && HWY_COMPILER_GCC_ACTUAL
// Part of that target by Highway's check of the processor, but not among its compiler options.
#pragma GCC target("avx512vnni")
#endif
namespace dtact::recon::vec::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET != HWY_SCALAR
/// Sums of products of pairs of neighbouring lanes. Some targets keep two partial sums and
/// spread them over the lanes until Total(): what is to be added once is added after it.
template <class D32>
struct PairSum {
  D32 d32;
  hn::VFromD<D32> sum0 = hn::Zero(d32);
  hn::VFromD<D32> sum1 = hn::Zero(d32);
  template <class V16>
  HWY_INLINE void Add(V16 values, V16 taps) {
#if HWY_TARGET == HWY_AVX3_DL && HWY_COMPILER_GCC_ACTUAL
    // One instruction where Highway 1.0 has two.
    if constexpr (hn::MaxLanes(D32()) == 16) {
      sum0.raw = _mm512_dpwssd_epi32(sum0.raw, values.raw, taps.raw);
      return;
    }
#endif
    sum0 = hn::ReorderWidenMulAccumulate(d32, values, taps, sum0, sum1);
  }
  HWY_INLINE hn::VFromD<D32> Total() { return hn::RearrangeToOddPlusEven(sum0, sum1); }
};
#endif

#include "daemon/recon/vector_lut-inl.hpp"
#include "daemon/recon/vector_rectify-inl.hpp"
#include "daemon/recon/vector_sharpen-inl.hpp"
#include "daemon/recon/vector_smooth-inl.hpp"
#include "daemon/recon/vector_sums-inl.hpp"
#include "daemon/recon/vector_upsample-inl.hpp"

const char* TargetName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace dtact::recon::vec::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dtact::recon::vec {

HWY_EXPORT(RectifyDifference);
HWY_EXPORT(RectifyMeanDifference);
HWY_EXPORT(SmoothAcross);
HWY_EXPORT(SmoothDown);
HWY_EXPORT(GainLutMask);
HWY_EXPORT(LitRow);
HWY_EXPORT(ShrinkRow);
HWY_EXPORT(SharpenRow);
HWY_EXPORT(SumRows);
HWY_EXPORT(BendRow);
HWY_EXPORT(WidenRow);
HWY_EXPORT(BetweenRow);
HWY_EXPORT(TargetName);

void rectify_difference(const RectifyPlan& plan, int y, int first, int last,
                        const std::uint8_t* luma, const RectifyTable::Entry* entries, int width,
                        const std::int16_t* reference_q6, std::int16_t* difference_q6) noexcept {
  HWY_DYNAMIC_DISPATCH(RectifyDifference)
  (plan, y, first, last, luma, entries, width, reference_q6, difference_q6);
}

void rectify_mean_difference(const RectifyPlan& plan, int decimation, int y, int first, int last,
                             const std::uint8_t* luma, const RectifyTable::Entry* entries,
                             int fine_width, const std::int16_t* reference_q6,
                             std::int16_t* difference_q6) noexcept {
  HWY_DYNAMIC_DISPATCH(RectifyMeanDifference)
  (plan, decimation, y, first, last, luma, entries, fine_width, reference_q6, difference_q6);
}

void smooth_across(const std::int16_t* row_a, const std::int16_t* row_b, const TapPairs& taps,
                   int first, int last, std::int16_t* pairs) noexcept {
  HWY_DYNAMIC_DISPATCH(SmoothAcross)(row_a, row_b, taps, first, last, pairs);
}

void smooth_down(const std::int16_t* const* pairs, const TapPairs& taps, int first, int last,
                 std::int16_t* row_a, std::int16_t* row_b) noexcept {
  HWY_DYNAMIC_DISPATCH(SmoothDown)(pairs, taps, first, last, row_a, row_b);
}

int gain_lut_mask(const LutRows& rows, const kernels::LutView& lut) noexcept {
  return HWY_DYNAMIC_DISPATCH(GainLutMask)(rows, lut);
}

void lit_row(const std::int16_t* difference_q6, const std::int16_t* gain_q12, int first, int last,
             std::int16_t* level_q6) noexcept {
  HWY_DYNAMIC_DISPATCH(LitRow)(difference_q6, gain_q12, first, last, level_q6);
}

void shrink_row(const std::int16_t* const* rows, int first, int last,
                std::int16_t* coarse) noexcept {
  HWY_DYNAMIC_DISPATCH(ShrinkRow)(rows, first, last, coarse);
}

void sharpen_row(const SharpenRows& rows, std::int16_t wide_share_q15, int first, int last,
                 std::int16_t* after) noexcept {
  HWY_DYNAMIC_DISPATCH(SharpenRow)(rows, wide_share_q15, first, last, after);
}

void sum_rows(const std::int16_t* depth_um, std::ptrdiff_t stride, int x0, int x1, int y0, int y1,
              DepthSums& sums) noexcept {
  HWY_DYNAMIC_DISPATCH(SumRows)(depth_um, stride, x0, x1, y0, y1, sums);
}

void bend_row(const std::int16_t* row_um, std::ptrdiff_t stride, int x0, int x1,
              DepthSums& sums) noexcept {
  HWY_DYNAMIC_DISPATCH(BendRow)(row_um, stride, x0, x1, sums);
}

void widen_row(const std::int16_t* coarse, const kernels::Phases& phases, int count,
               std::int16_t* fine) noexcept {
  HWY_DYNAMIC_DISPATCH(WidenRow)(coarse, phases, count, fine);
}

void between_row(const std::int16_t* near, const std::int16_t* other, std::int16_t share_q15,
                 int width, std::int16_t* out) noexcept {
  HWY_DYNAMIC_DISPATCH(BetweenRow)(near, other, share_q15, width, out);
}

const char* target_name() noexcept { return HWY_DYNAMIC_DISPATCH(TargetName)(); }

TapPairs::TapPairs(std::span<const std::int16_t> taps)
    : radius_((static_cast<int>(taps.size()) - 1 + 1) / 2 * 2) {
  // A zero before the first tap and after the last: `second` begins one place earlier.
  std::vector<std::int32_t> full(2 * static_cast<std::size_t>(radius_) + 3);
  const std::size_t centre = static_cast<std::size_t>(radius_) + 1;
  for (std::size_t k = 0; k < taps.size(); ++k) {
    full[centre - k] = taps[k];
    full[centre + k] = taps[k];
  }
  for (const std::size_t begin : {std::size_t{1}, std::size_t{0}}) {
    for (std::size_t j = 0; j < static_cast<std::size_t>(count()); ++j) {
      words_.push_back(full[begin + 2 * j + 1] << 16 | full[begin + 2 * j]);
    }
  }
}

}  // namespace dtact::recon::vec
#endif  // HWY_ONCE
