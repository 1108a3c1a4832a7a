#include "daemon/recon/vector_kernels.hpp"

#include <algorithm>
#include <cstring>

#include "daemon/recon/model.hpp"
#include "daemon/recon/vector_targets.hpp"
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

constexpr int kGroup = RectifyPlan::kGroup;
constexpr int kGroups = RectifyPlan::kGroups;

/// Pixels [x0, x1) one by one: for blocks that the plan leaves to it, and where there are no
/// vectors at all.
void RectifyScalar(const uint8_t* luma, std::ptrdiff_t stride, const RectifyTable::Entry* entries,
                   int x0, int x1, const int16_t* reference_q6, int16_t* difference_q6) {
  if (x0 >= x1) return;
  kernels::rectify_difference_row(luma, stride, entries + x0, reference_q6 + x0, x1 - x0,
                                  difference_q6 + x0);
}

#if HWY_TARGET == HWY_SCALAR

void RectifyDifference(const RectifyPlan& plan, int, int first, int last, const uint8_t* luma,
                       const RectifyTable::Entry* entries, int width, const int16_t* reference_q6,
                       int16_t* difference_q6) {
  RectifyScalar(luma, plan.stride(), entries, first * kGroup, HWY_MIN(last * kGroup, width),
                reference_q6, difference_q6);
}

int32_t Round(int32_t q14) { return (q14 + (1 << 13)) >> 14; }
int32_t LowTap(int32_t word) { return static_cast<int16_t>(word); }
int32_t HighTap(int32_t word) { return word >> 16; }

void SmoothAcross(const int16_t* row_a, const int16_t* row_b, const TapPairs& taps, int first,
                  int last, int16_t* pairs) {
  for (int x = first * kBlock; x < last * kBlock; ++x) {
    const int in_block = x % kBlock;
    int16_t* out = pairs + 2 * (x - in_block) + kBlock * (in_block % 2) + in_block / 2 * 2;
    const int16_t* rows[2] = {row_a, row_b};
    for (int i = 0; i < 2; ++i) {
      const int16_t* from = rows[i] + x - taps.radius();
      // The last word's high half is no tap: what it would meet may lie beyond the row.
      int32_t sum = LowTap(taps.words()[taps.radius()]) * from[2 * taps.radius()];
      for (int j = 0; j < taps.radius(); ++j) {
        sum += LowTap(taps.words()[j]) * from[2 * j];
        sum += HighTap(taps.words()[j]) * from[2 * j + 1];
      }
      out[i] = static_cast<int16_t>(Round(sum));
    }
  }
}

void SmoothDown(const int16_t* const* pairs, const TapPairs& taps, int first, int last,
                int16_t* row_a, int16_t* row_b) {
  for (int x = first * kBlock; x < last * kBlock; ++x) {
    const int in_block = x % kBlock;
    const int at = 2 * (x - in_block) + kBlock * (in_block % 2) + in_block / 2 * 2;
    int32_t a = 0;
    int32_t b = 0;
    for (int j = 0; j < taps.count(); ++j) {
      const int16_t* pair = pairs[j] + at;
      a += LowTap(taps.words()[j]) * pair[0] + HighTap(taps.words()[j]) * pair[1];
      b += LowTap(taps.words()[taps.count() + j]) * pair[0] +
           HighTap(taps.words()[taps.count() + j]) * pair[1];
    }
    row_a[x] = static_cast<int16_t>(Round(a));
    row_b[x] = static_cast<int16_t>(Round(b));
  }
}

int GainListMask(const ListRows& rows, const kernels::LookUp& list) {
  int beyond = 0;
  for (int y = 0; y < rows.height; ++y) {
    for (int x = 0; x < rows.width; ++x) {
      const int16_t* gain =
          rows.gain_q12 == nullptr ? nullptr : rows.gain_q12 + y * rows.gain_stride + x;
      const uint8_t untrusted = gain != nullptr && *gain == 0 ? 1 : 0;
      beyond += kernels::gain_list_mask_row(rows.difference_q6 + y * rows.difference_stride + x,
                                            gain, &untrusted, list, 1,
                                            rows.depth_um + y * rows.depth_stride + x);
    }
  }
  return beyond;
}

#else

/// Sixteen bytes from each of the vector's groups, one after the other.
template <class D8>
HWY_INLINE hn::VFromD<D8> LoadGroups(D8 d8, const uint8_t* luma, const int32_t* at) {
  if constexpr (hn::MaxLanes(d8) <= RectifyPlan::kBytes) {
    return hn::LoadU(d8, luma + at[0]);
  } else {
    const hn::Half<D8> half;
    constexpr size_t kGroupsInHalf = hn::MaxLanes(half) / RectifyPlan::kBytes;
    return hn::Combine(d8, LoadGroups(half, luma, at + kGroupsInHalf), LoadGroups(half, luma, at));
  }
}

/// left · (128 − fx) + right · fx for (left, right) pairs of bytes, less kAcrossLow: int16 holds
/// every step. Weights() makes of fx what Across() wants.
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
constexpr int32_t kAcrossLow = 128 * 128;

// Weights up to 128 are the unsigned factor; pixels become signed by 128 less, weights adding up to
// 128. Highway 1.0 does not have this instruction.
HWY_INLINE hn::Vec128<int16_t> MulPairs(hn::Vec128<int16_t> weights, hn::Vec128<int16_t> pixels) {
  return hn::Vec128<int16_t>{_mm_maddubs_epi16(weights.raw, pixels.raw)};
}
HWY_INLINE hn::Vec256<int16_t> MulPairs(hn::Vec256<int16_t> weights, hn::Vec256<int16_t> pixels) {
  return hn::Vec256<int16_t>{_mm256_maddubs_epi16(weights.raw, pixels.raw)};
}
#if HWY_TARGET != HWY_AVX2
HWY_INLINE hn::Vec512<int16_t> MulPairs(hn::Vec512<int16_t> weights, hn::Vec512<int16_t> pixels) {
  return hn::Vec512<int16_t>{_mm512_maddubs_epi16(weights.raw, pixels.raw)};
}
#endif
template <class D16, class V16>
HWY_INLINE V16 Weights(D16 d16, V16 fx) {
  return hn::Add(hn::Sub(hn::ShiftLeft<8>(fx), fx), hn::Set(d16, 128));
}
template <class D16, class V16>
HWY_INLINE V16 Across(D16 d16, V16 pairs, V16 weights) {
  return MulPairs(weights, hn::Xor(pairs, hn::Set(d16, static_cast<int16_t>(0x8080))));
}
#else
constexpr int32_t kAcrossLow = 0;

template <class D16, class V16>
HWY_INLINE V16 Weights(D16 /*d16*/, V16 fx) {
  return fx;
}
template <class D16, class V16>
HWY_INLINE V16 Across(D16 d16, V16 pairs, V16 fx) {
  const hn::RebindToUnsigned<D16> du16;
  const V16 left = hn::And(pairs, hn::Set(d16, 0xFF));
  const V16 right = hn::BitCast(d16, hn::ShiftRight<8>(hn::BitCast(du16, pairs)));
  return hn::Add(hn::ShiftLeft<7>(left), hn::Mul(hn::Sub(right, left), fx));
}
#endif

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

/// The pixels of as many groups as `d16` has room for; `at`: where each group's bytes begin in
/// luma. kLevels 0: block.levels.
template <int kLevels, class D16>
HWY_INLINE void RectifyGroups(D16 d16, const RectifyPlan::Block& block, const uint8_t* data,
                              int group, const uint8_t* luma, std::ptrdiff_t stride,
                              const int16_t* reference_q6, int16_t* difference_q6) {
  using V16 = hn::VFromD<D16>;
  const hn::Repartition<uint8_t, D16> d8;
  const hn::RepartitionToWide<D16> d32;
  const hn::Rebind<uint8_t, D16> d8_half;
  const hn::RebindToUnsigned<D16> du16;
  const int levels = kLevels == 0 ? block.levels : kLevels;
  const int32_t* const at = block.at + group;
  const uint8_t* const own = data + std::ptrdiff_t{group} * kGroup;
  const auto place = hn::PromoteTo(du16, hn::LoadU(d8_half, own));
  const V16 fx = hn::BitCast(d16, hn::PromoteTo(du16, hn::LoadU(d8_half, own + kBlock)));
  const V16 fy =
      hn::BitCast(d16, hn::PromoteTo(du16, hn::LoadU(d8_half, own + std::ptrdiff_t{2} * kBlock)));

  // The byte at a pixel's column and the one after it.
  const auto column = levels == 1 ? place : hn::And(place, hn::Set(du16, 0xF));
  const auto index =
      hn::BitCast(d8, hn::Add(hn::Or(column, hn::ShiftLeft<8>(column)), hn::Set(du16, 0x100)));
  V16 upper = hn::BitCast(d16, hn::TableLookupBytes(LoadGroups(d8, luma, at), index));
  V16 lower = hn::BitCast(d16, hn::TableLookupBytes(LoadGroups(d8, luma + stride, at), index));
  for (int level = 1; level < levels; ++level) {
    const uint8_t* const below = luma + (level + 1) * stride;
    const V16 next = hn::BitCast(d16, hn::TableLookupBytes(LoadGroups(d8, below, at), index));
    const auto deeper =
        hn::Gt(hn::BitCast(d16, place), hn::Set(d16, static_cast<int16_t>((level << 4) - 1)));
    upper = hn::IfThenElse(deeper, lower, upper);
    lower = hn::IfThenElse(deeper, next, lower);
  }

  const V16 weights = Weights(d16, fx);
  const V16 above_q7 = Across(d16, upper, weights);
  const V16 below_q7 = Across(d16, lower, weights);
  const V16 rest = hn::Sub(hn::Set(d16, 128), fy);
  const auto half = hn::Set(d32, (1 << 7) + 128 * kAcrossLow);
  // Pairs (above, below) times pairs of weights. Interleaving and packing undo each other within
  // every 128 bits.
  PairSum<decltype(d32)> low{d32};
  PairSum<decltype(d32)> high{d32};
  low.Add(hn::InterleaveLower(d16, above_q7, below_q7), hn::InterleaveLower(d16, rest, fy));
  high.Add(hn::InterleaveUpper(d16, above_q7, below_q7), hn::InterleaveUpper(d16, rest, fy));
  const V16 luma_q6 = hn::ReorderDemote2To(d16, hn::ShiftRight<8>(hn::Add(low.Total(), half)),
                                           hn::ShiftRight<8>(hn::Add(high.Total(), half)));
  const int x = group * kGroup;
  hn::StoreU(hn::Sub(hn::LoadU(d16, reference_q6 + x), luma_q6), d16, difference_q6 + x);
}

/// The groups [first, last) of one block.
template <int kLevels>
HWY_INLINE void RectifyBlock(const RectifyPlan::Block& block, const uint8_t* data, int first,
                             int last, const uint8_t* luma, std::ptrdiff_t stride,
                             const int16_t* reference_q6, int16_t* difference_q6) {
  const hn::CappedTag<int16_t, kBlock> wide;
  const hn::CappedTag<int16_t, kGroup> narrow;
  constexpr int kWide = static_cast<int>(hn::MaxLanes(wide) / kGroup);
  if (last - first == kGroups) {
    for (int g = 0; g < kGroups; g += kWide) {
      RectifyGroups<kLevels>(wide, block, data, g, luma, stride, reference_q6, difference_q6);
    }
  } else {
    for (int g = first; g < last; ++g) {
      RectifyGroups<kLevels>(narrow, block, data, g, luma, stride, reference_q6, difference_q6);
    }
  }
}

void RectifyDifference(const RectifyPlan& plan, int y, int first, int last, const uint8_t* luma,
                       const RectifyTable::Entry* entries, int width, const int16_t* reference_q6,
                       int16_t* difference_q6) {
  const std::ptrdiff_t stride = plan.stride();
  const RectifyPlan::Block* block = plan.row(y) + first / kGroups;
  const uint8_t* data = plan.data(y) + std::ptrdiff_t{first / kGroups} * RectifyPlan::kBlockData;
  for (int begin = first / kGroups * kGroups; begin < last; begin += kGroups) {
    const int from = HWY_MAX(first - begin, 0);
    const int to = HWY_MIN(last - begin, kGroups);
    const int16_t* const reference = reference_q6 + std::ptrdiff_t{begin} * kGroup;
    int16_t* const difference = difference_q6 + std::ptrdiff_t{begin} * kGroup;
    switch (block->levels) {
      case 0:
        RectifyScalar(luma, stride, entries, (begin + from) * kGroup,
                      HWY_MIN((begin + to) * kGroup, width), reference_q6, difference_q6);
        break;
      case 1:
        RectifyBlock<1>(*block, data, from, to, luma, stride, reference, difference);
        break;
      case 2:
        RectifyBlock<2>(*block, data, from, to, luma, stride, reference, difference);
        break;
      default:
        RectifyBlock<0>(*block, data, from, to, luma, stride, reference, difference);
    }
    ++block;
    data += RectifyPlan::kBlockData;
  }
}

/// Q14 sums of the even and of the odd columns to rounded int16: the odd ones' sixteen low bits go
/// to the upper half of each word.
template <class D16, class V32>
HWY_INLINE hn::VFromD<D16> Merge(D16 d16, V32 even, V32 odd) {
  const auto half = hn::Set(hn::DFromV<V32>(), 1 << 13);
  return hn::OddEven(hn::BitCast(d16, hn::ShiftLeft<2>(hn::Add(odd, half))),
                     hn::BitCast(d16, hn::ShiftRight<14>(hn::Add(even, half))));
}

/// kCount 0: taps.count(); else the loop over the taps is laid out by the compiler.
template <int kCount>
HWY_NOINLINE void SmoothAcrossTaps(const int16_t* row_a, const int16_t* row_b, const TapPairs& taps,
                                   int first, int last, int16_t* pairs) {
  const hn::CappedTag<int16_t, kBlock> d16;
  const hn::RepartitionToWide<decltype(d16)> d32;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d16));
  const int radius = taps.radius();
  const int count = kCount == 0 ? taps.count() : kCount;
  const int32_t* HWY_RESTRICT words = taps.words();
  for (int x = first * kBlock; x < last * kBlock; x += kLanes) {
    PairSum<decltype(d32)> even_a{d32}, even_b{d32}, odd_a{d32}, odd_b{d32};
    for (int j = 0; j < count; ++j) {
      const auto first_taps = hn::BitCast(d16, hn::Set(d32, words[j]));
      const auto second_taps = hn::BitCast(d16, hn::Set(d32, words[count + j]));
      const auto a = hn::LoadU(d16, row_a + (x - radius + 2 * j));
      const auto b = hn::LoadU(d16, row_b + (x - radius + 2 * j));
      even_a.Add(a, first_taps);
      odd_a.Add(a, second_taps);
      even_b.Add(b, first_taps);
      odd_b.Add(b, second_taps);
    }
    int16_t* const out = pairs + (2 * (x & -kBlock) + (x & (kBlock - 1)));
    hn::StoreU(Merge(d16, even_a.Total(), even_b.Total()), d16, out);
    hn::StoreU(Merge(d16, odd_a.Total(), odd_b.Total()), d16, out + kBlock);
  }
}

void SmoothAcross(const int16_t* row_a, const int16_t* row_b, const TapPairs& taps, int first,
                  int last, int16_t* pairs) {
  switch (taps.count()) {
    case 5:
      return SmoothAcrossTaps<5>(row_a, row_b, taps, first, last, pairs);
    case 7:
      return SmoothAcrossTaps<7>(row_a, row_b, taps, first, last, pairs);
    default:
      return SmoothAcrossTaps<0>(row_a, row_b, taps, first, last, pairs);
  }
}

template <int kCount>
HWY_NOINLINE void SmoothDownTaps(const int16_t* const* pairs, const TapPairs& taps, int first,
                                 int last, int16_t* row_a, int16_t* row_b) {
  const hn::CappedTag<int16_t, kBlock> d16;
  const hn::RepartitionToWide<decltype(d16)> d32;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d16));
  const int count = kCount == 0 ? taps.count() : kCount;
  const int32_t* HWY_RESTRICT words = taps.words();
  for (int x = first * kBlock; x < last * kBlock; x += kLanes) {
    const int at = 2 * (x & -kBlock) + (x & (kBlock - 1));
    PairSum<decltype(d32)> even_a{d32}, even_b{d32}, odd_a{d32}, odd_b{d32};
    for (int j = 0; j < count; ++j) {
      const auto first_taps = hn::BitCast(d16, hn::Set(d32, words[j]));
      const auto second_taps = hn::BitCast(d16, hn::Set(d32, words[count + j]));
      const auto even = hn::LoadU(d16, pairs[j] + at);
      const auto odd = hn::LoadU(d16, pairs[j] + at + kBlock);
      even_a.Add(even, first_taps);
      odd_a.Add(odd, first_taps);
      even_b.Add(even, second_taps);
      odd_b.Add(odd, second_taps);
    }
    hn::StoreU(Merge(d16, even_a.Total(), odd_a.Total()), d16, row_a + x);
    hn::StoreU(Merge(d16, even_b.Total(), odd_b.Total()), d16, row_b + x);
  }
}

void SmoothDown(const int16_t* const* pairs, const TapPairs& taps, int first, int last,
                int16_t* row_a, int16_t* row_b) {
  switch (taps.count()) {
    case 5:
      return SmoothDownTaps<5>(pairs, taps, first, last, row_a, row_b);
    case 7:
      return SmoothDownTaps<7>(pairs, taps, first, last, row_a, row_b);
    default:
      return SmoothDownTaps<0>(pairs, taps, first, last, row_a, row_b);
  }
}

/// um[places[i]]. Eight entries are put together in a register: one store each would be the limit,
/// and the gather instruction is slower than that.
HWY_INLINE void LookUp(const int16_t* HWY_RESTRICT um, const uint16_t* HWY_RESTRICT places,
                       int count, int16_t* HWY_RESTRICT depth_um) {
  using Eight = int16_t __attribute__((vector_size(16)));
  int i = 0;
  for (; i + 8 <= count; i += 8) {
    const uint16_t* at = places + i;
    Eight eight{};
    for (int k = 0; k < 8; ++k) eight[k] = um[at[k]];
    std::memcpy(depth_um + i, &eight, sizeof(eight));
  }
  for (; i < count; ++i) depth_um[i] = um[places[i]];
}

template <bool kGain>
HWY_NOINLINE int GainListMaskRows(const ListRows& rows, const kernels::LookUp& list) {
  const hn::CappedTag<int16_t, kBlock> d16;
  const hn::RepartitionToWide<decltype(d16)> d32;
  const hn::RebindToUnsigned<decltype(d16)> du16;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d16));
  // Places in the list are found by vectors and looked up one by one.
  constexpr int kChunk = 20 * kBlock;
  HWY_ALIGN uint16_t places[kChunk];
  const auto first = hn::Set(d16, static_cast<int16_t>(list.first_q6));
  const auto last = hn::Set(d16, static_cast<int16_t>(list.last_q6));
  const auto covered = hn::Set(d16, static_cast<int16_t>(list.covered_q6));
  const auto marker = hn::Set(d16, static_cast<int16_t>(list.last_q6 + 1 - list.first_q6));
  const auto half = hn::Set(d32, 1 << 11);
  size_t beyond = 0;
  for (int y = 0; y < rows.height; ++y) {
    const int16_t* HWY_RESTRICT difference = rows.difference_q6 + y * rows.difference_stride;
    const int16_t* HWY_RESTRICT gains = kGain ? rows.gain_q12 + y * rows.gain_stride : nullptr;
    int16_t* HWY_RESTRICT depth = rows.depth_um + y * rows.depth_stride;
    for (int begin = 0; begin < rows.width; begin += kChunk) {
      const int end = HWY_MIN(begin + kChunk, rows.width);
      for (int x = begin; x < end; x += kLanes) {
        auto lit = hn::LoadU(d16, difference + x);
        auto trusted = hn::Eq(lit, lit);
        if constexpr (kGain) {
          const auto gain = hn::LoadU(d16, gains + x);
          trusted = hn::Ne(gain, hn::Zero(d16));
          const auto low = hn::Mul(lit, gain);
          const auto high = hn::MulHigh(lit, gain);
          const auto product_l = hn::BitCast(d32, hn::InterleaveLower(d16, low, high));
          const auto product_h = hn::BitCast(d32, hn::InterleaveUpper(d16, low, high));
          lit = hn::ReorderDemote2To(d16, hn::ShiftRight<12>(hn::Add(product_l, half)),
                                     hn::ShiftRight<12>(hn::Add(product_h, half)));
        }
        const auto too_dark = hn::And(hn::Gt(lit, covered), trusted);
        const auto place =
            hn::IfThenElse(trusted, hn::Sub(hn::Min(hn::Max(lit, first), last), first), marker);
        if (HWY_UNLIKELY(!hn::AllFalse(d16, too_dark))) {
          const auto inside = hn::FirstN(d16, static_cast<size_t>(end - x));
          beyond += hn::CountTrue(d16, hn::And(too_dark, inside));
        }
        hn::Store(hn::BitCast(du16, place), du16, places + (x - begin));
      }
      LookUp(list.um, places, end - begin, depth + begin);
    }
  }
  return static_cast<int>(beyond);
}

int GainListMask(const ListRows& rows, const kernels::LookUp& list) {
  return rows.gain_q12 == nullptr ? GainListMaskRows<false>(rows, list)
                                  : GainListMaskRows<true>(rows, list);
}

#endif  // HWY_TARGET == HWY_SCALAR

const char* TargetName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace dtact::recon::vec::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dtact::recon::vec {

HWY_EXPORT(RectifyDifference);
HWY_EXPORT(SmoothAcross);
HWY_EXPORT(SmoothDown);
HWY_EXPORT(GainListMask);
HWY_EXPORT(TargetName);

void rectify_difference(const RectifyPlan& plan, int y, int first, int last,
                        const std::uint8_t* luma, const RectifyTable::Entry* entries, int width,
                        const std::int16_t* reference_q6, std::int16_t* difference_q6) noexcept {
  HWY_DYNAMIC_DISPATCH(RectifyDifference)
  (plan, y, first, last, luma, entries, width, reference_q6, difference_q6);
}

void smooth_across(const std::int16_t* row_a, const std::int16_t* row_b, const TapPairs& taps,
                   int first, int last, std::int16_t* pairs) noexcept {
  HWY_DYNAMIC_DISPATCH(SmoothAcross)(row_a, row_b, taps, first, last, pairs);
}

void smooth_down(const std::int16_t* const* pairs, const TapPairs& taps, int first, int last,
                 std::int16_t* row_a, std::int16_t* row_b) noexcept {
  HWY_DYNAMIC_DISPATCH(SmoothDown)(pairs, taps, first, last, row_a, row_b);
}

int gain_list_mask(const ListRows& rows, const kernels::LookUp& list) noexcept {
  return HWY_DYNAMIC_DISPATCH(GainListMask)(rows, list);
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
