// Gain, list and mask.
// Part of vector_kernels.cpp, which includes it once for each of Highway's targets.

#if HWY_TARGET == HWY_SCALAR

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
    // The published method writes its depth over its difference: neither is restricted.
    const int16_t* difference = rows.difference_q6 + y * rows.difference_stride;
    const int16_t* HWY_RESTRICT gains = kGain ? rows.gain_q12 + y * rows.gain_stride : nullptr;
    int16_t* depth = rows.depth_um + y * rows.depth_stride;
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
