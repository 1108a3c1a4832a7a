// Rectification and difference.
// Part of vector_kernels.cpp, which includes it once for each of Highway's targets.

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

/// The same for a coarse map: pixels [x0, x1) of the fine ones, whole coarse ones.
void RectifyMeanScalar(const uint8_t* luma, std::ptrdiff_t stride,
                       const RectifyTable::Entry* entries, int fine_width, int decimation, int x0,
                       int x1, const int16_t* reference_q6, int16_t* difference_q6) {
  if (x0 >= x1) return;
  kernels::rectify_mean_difference_row(luma, stride, entries + x0, fine_width, decimation,
                                       reference_q6 + x0 / decimation, (x1 - x0) / decimation,
                                       difference_q6 + x0 / decimation);
}

#if HWY_TARGET == HWY_SCALAR

void RectifyMeanDifference(const RectifyPlan& plan, int decimation, int, int first, int last,
                           const uint8_t* luma, const RectifyTable::Entry* entries, int fine_width,
                           const int16_t* reference_q6, int16_t* difference_q6) {
  RectifyMeanScalar(luma, plan.stride(), entries, fine_width, decimation, first * kGroup,
                    HWY_MIN(last * kGroup, fine_width), reference_q6, difference_q6);
}

void RectifyDifference(const RectifyPlan& plan, int, int first, int last, const uint8_t* luma,
                       const RectifyTable::Entry* entries, int width, const int16_t* reference_q6,
                       int16_t* difference_q6) {
  RectifyScalar(luma, plan.stride(), entries, first * kGroup, HWY_MIN(last * kGroup, width),
                reference_q6, difference_q6);
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

/// A vector of pixels read across: the upper and the lower of the two rows that each lies between,
/// and how far below the upper one, of 128.
template <class V16>
struct Readings {
  V16 above_q7;
  V16 below_q7;
  V16 fy;
};

/// The pixels of as many groups as `d16` has room for; `at`: where each group's bytes begin in
/// luma. kLevels 0: block.levels.
template <int kLevels, class D16>
HWY_INLINE Readings<hn::VFromD<D16> > ReadGroups(D16 d16, const RectifyPlan::Block& block,
                                                 const uint8_t* data, int group,
                                                 const uint8_t* luma, std::ptrdiff_t stride) {
  using V16 = hn::VFromD<D16>;
  const hn::Repartition<uint8_t, D16> d8;
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
  return {Across(d16, upper, weights), Across(d16, lower, weights), fy};
}

/// One row of a full map.
template <int kLevels, class D16>
HWY_INLINE void RectifyGroups(D16 d16, const RectifyPlan::Block& block, const uint8_t* data,
                              int group, const uint8_t* luma, std::ptrdiff_t stride,
                              const int16_t* reference_q6, int16_t* difference_q6) {
  using V16 = hn::VFromD<D16>;
  const hn::RepartitionToWide<D16> d32;
  const auto [above_q7, below_q7, fy] = ReadGroups<kLevels>(d16, block, data, group, luma, stride);
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

/// The means of the groups that `d16` has room for, from `group` of one block on.
template <int kDecimation, class D16>
HWY_INLINE void RectifyMeanGroups(D16 d16, const RectifyPlan& plan, int y, int block, int group,
                                  const uint8_t* luma, const int16_t* reference_q6,
                                  int16_t* difference_q6) {
  using V16 = hn::VFromD<D16>;
  const hn::RepartitionToWide<D16> d32;
  const std::ptrdiff_t stride = plan.stride();
  const V16 whole = hn::Set(d16, 128);
  // Neighbours in a row belong to one mean: their products are added up at once.
  PairSum<decltype(d32)> sum{d32};
  const auto add = [&](const Readings<V16>& read) HWY_ATTR {
    sum.Add(read.above_q7, hn::Sub(whole, read.fy));
    sum.Add(read.below_q7, read.fy);
  };
  for (int k = 0; k < kDecimation; ++k) {
    const RectifyPlan::Block& here = plan.row(y * kDecimation + k)[block];
    const uint8_t* const data =
        plan.data(y * kDecimation + k) + std::ptrdiff_t{block} * RectifyPlan::kBlockData;
    if (here.levels == 1) {
      add(ReadGroups<1>(d16, here, data, group, luma, stride));
    } else if (here.levels == 2) {
      add(ReadGroups<2>(d16, here, data, group, luma, stride));
    } else {
      add(ReadGroups<0>(d16, here, data, group, luma, stride));
    }
  }
  constexpr int kPixels = kDecimation * kDecimation;
  constexpr int kShift = kDecimation == 2 ? 10 : 12;
  const auto half = hn::Set(d32, (1 << (kShift - 1)) + kPixels * 128 * kAcrossLow);
  const int x = (block * kGroups + group) * kGroup / kDecimation;
  if constexpr (kDecimation == 2) {
    const hn::Rebind<int16_t, decltype(d32)> d_out;
    const auto mean_q6 = hn::DemoteTo(d_out, hn::ShiftRight<kShift>(hn::Add(sum.Total(), half)));
    hn::StoreU(hn::Sub(hn::LoadU(d_out, reference_q6 + x), mean_q6), d_out, difference_q6 + x);
  } else {
    const hn::Half<decltype(d32)> d_half;
    const hn::Rebind<int16_t, decltype(d_half)> d_out;
    const auto pairs = sum.Total();
    const auto left = hn::LowerHalf(d_half, hn::ConcatEven(d32, pairs, pairs));
    const auto right = hn::LowerHalf(d_half, hn::ConcatOdd(d32, pairs, pairs));
    const auto total = hn::Add(hn::Add(left, right), hn::LowerHalf(d_half, half));
    const auto mean_q6 = hn::DemoteTo(d_out, hn::ShiftRight<kShift>(total));
    hn::StoreU(hn::Sub(hn::LoadU(d_out, reference_q6 + x), mean_q6), d_out, difference_q6 + x);
  }
}

template <int kDecimation>
HWY_NOINLINE void RectifyMean(const RectifyPlan& plan, int y, int first, int last,
                              const uint8_t* luma, const RectifyTable::Entry* entries,
                              int fine_width, const int16_t* reference_q6, int16_t* difference_q6) {
  const hn::CappedTag<int16_t, kBlock> wide;
  const hn::CappedTag<int16_t, kGroup> narrow;
  constexpr int kWide = static_cast<int>(hn::MaxLanes(wide) / kGroup);
  for (int begin = first / kGroups * kGroups; begin < last; begin += kGroups) {
    const int block = begin / kGroups;
    const int from = HWY_MAX(first - begin, 0);
    const int to = HWY_MIN(last - begin, kGroups);
    bool near = true;
    for (int k = 0; k < kDecimation; ++k) {
      near = near && plan.row(y * kDecimation + k)[block].levels != 0;
    }
    if (!near) {
      RectifyMeanScalar(luma, plan.stride(), entries, fine_width, kDecimation,
                        (begin + from) * kGroup, HWY_MIN((begin + to) * kGroup, fine_width),
                        reference_q6, difference_q6);
    } else if (to - from == kGroups) {
      for (int g = 0; g < kGroups; g += kWide) {
        RectifyMeanGroups<kDecimation>(wide, plan, y, block, g, luma, reference_q6, difference_q6);
      }
    } else {
      for (int g = from; g < to; ++g) {
        RectifyMeanGroups<kDecimation>(narrow, plan, y, block, g, luma, reference_q6,
                                       difference_q6);
      }
    }
  }
}

void RectifyMeanDifference(const RectifyPlan& plan, int decimation, int y, int first, int last,
                           const uint8_t* luma, const RectifyTable::Entry* entries, int fine_width,
                           const int16_t* reference_q6, int16_t* difference_q6) {
  if (decimation == 2) {
    RectifyMean<2>(plan, y, first, last, luma, entries, fine_width, reference_q6, difference_q6);
  } else {
    RectifyMean<4>(plan, y, first, last, luma, entries, fine_width, reference_q6, difference_q6);
  }
}

#endif  // HWY_TARGET == HWY_SCALAR
