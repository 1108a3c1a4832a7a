// Gain, LUT and mask.
// Part of vector_kernels.cpp, which includes it once for each of Highway's targets.

#if HWY_TARGET == HWY_SCALAR

int GainLutMask(const LutRows& rows, const kernels::LutView& lut) {
  int beyond = 0;
  for (int y = 0; y < rows.height; ++y) {
    for (int x = 0; x < rows.width; ++x) {
      const int16_t* gain =
          rows.gain_q12 == nullptr ? nullptr : rows.gain_q12 + y * rows.gain_stride + x;
      const uint8_t untrusted = gain != nullptr && *gain == 0 ? 1 : 0;
      beyond +=
          kernels::gain_lut_mask_row(rows.difference_q6 + y * rows.difference_stride + x, gain,
                                     &untrusted, lut, 1, rows.depth_um + y * rows.depth_stride + x);
    }
  }
  return beyond;
}

#else

/// um[places[i]]. Eight entries are put together in a register: one store each would be the limit,
/// and the gather instruction is slower than that.
HWY_INLINE void LutView(const int16_t* HWY_RESTRICT um, const uint16_t* HWY_RESTRICT places,
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

/// The difference under its gain, as kernels::gain_lut_mask_row has it.
template <class D16, class V16>
HWY_INLINE V16 Lit(D16 d16, V16 difference, V16 gain) {
  const hn::RepartitionToWide<D16> d32;
  const auto half = hn::Set(d32, 1 << 11);
  const V16 low = hn::Mul(difference, gain);
  const V16 high = hn::MulHigh(difference, gain);
  const auto product_l = hn::BitCast(d32, hn::InterleaveLower(d16, low, high));
  const auto product_h = hn::BitCast(d32, hn::InterleaveUpper(d16, low, high));
  return hn::ReorderDemote2To(d16, hn::ShiftRight<12>(hn::Add(product_l, half)),
                              hn::ShiftRight<12>(hn::Add(product_h, half)));
}

template <bool kGain>
HWY_NOINLINE int GainLutMaskRows(const LutRows& rows, const kernels::LutView& lut) {
  const hn::CappedTag<int16_t, kBlock> d16;
  const hn::RebindToUnsigned<decltype(d16)> du16;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d16));
  // Places in the LUT are found by vectors and looked up one by one.
  constexpr int kChunk = 20 * kBlock;
  HWY_ALIGN uint16_t places[kChunk];
  const auto first = hn::Set(d16, static_cast<int16_t>(lut.first_q6));
  const auto last = hn::Set(d16, static_cast<int16_t>(lut.last_q6));
  const auto covered = hn::Set(d16, static_cast<int16_t>(lut.covered_q6));
  const auto marker = hn::Set(d16, static_cast<int16_t>(lut.last_q6 + 1 - lut.first_q6));
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
          lit = Lit(d16, lit, gain);
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
      LutView(lut.um, places, end - begin, depth + begin);
    }
  }
  return static_cast<int>(beyond);
}

#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
#define DTACT_KNOTS_IN_REGISTERS

/// 128 values in registers, looked up by the low seven bits of `at`.
struct Registers {
  using V16 = hn::Vec512<int16_t>;
  explicit HWY_INLINE Registers(const std::array<int16_t, kernels::Knots::kCount>& values)
      : v0(_mm512_load_si512(values.data())),
        v1(_mm512_load_si512(values.data() + 32)),
        v2(_mm512_load_si512(values.data() + 64)),
        v3(_mm512_load_si512(values.data() + 96)) {}
  // Highway 1.0 has no look-up of 16 bits in two registers.
  HWY_INLINE V16 operator()(V16 at, hn::Mask512<int16_t> upper) const {
    const __m512i low = _mm512_permutex2var_epi16(v0, at.raw, v1);
    const __m512i high = _mm512_permutex2var_epi16(v2, at.raw, v3);
    return V16{_mm512_mask_mov_epi16(low, upper.raw, high)};
  }
  __m512i v0;
  __m512i v1;
  __m512i v2;
  __m512i v3;
};

/// The same for a LUT of knots: no table is read.
template <int kStepBits>
HWY_NOINLINE int GainKnotsMaskRows(const LutRows& rows, const kernels::LutView& lut) {
  const hn::Full512<int16_t> d16;
  constexpr int kLanes = 32;
  const Registers knots(lut.knots->at_q3);
  const Registers rises(lut.knots->rise_q3);
  const auto first = hn::Set(d16, static_cast<int16_t>(lut.first_q6));
  const auto covered = hn::Set(d16, static_cast<int16_t>(lut.covered_q6));
  const auto half = hn::Set(d16, 1 << (kernels::Knots::kFraction - 1));
  size_t beyond = 0;
  for (int y = 0; y < rows.height; ++y) {
    const int16_t* difference = rows.difference_q6 + y * rows.difference_stride;
    const int16_t* HWY_RESTRICT gains = rows.gain_q12 + y * rows.gain_stride;
    int16_t* depth = rows.depth_um + y * rows.depth_stride;
    for (int x = 0; x < rows.width; x += kLanes) {
      const auto gain = hn::LoadU(d16, gains + x);
      const auto lit = Lit(d16, hn::LoadU(d16, difference + x), gain);
      const auto trusted = hn::Ne(gain, hn::Zero(d16));
      const auto too_dark = hn::And(hn::Gt(lit, covered), trusted);
      const auto place = hn::Sub(hn::Min(hn::Max(lit, first), covered), first);
      const auto knot = hn::ShiftRight<kStepBits>(place);
      const auto upper = hn::TestBit(knot, hn::Set(d16, 64));
      // What is left of the place, Q15: the product with it is rounded as between() rounds.
      const auto inside = hn::ShiftRight<1>(
          hn::BitCast(hn::RebindToUnsigned<decltype(d16)>(), hn::ShiftLeft<16 - kStepBits>(place)));
      const auto rise = hn::MulFixedPoint15(rises(knot, upper), hn::BitCast(d16, inside));
      const auto um = hn::ShiftRight<kernels::Knots::kFraction>(
          hn::Add(hn::Add(knots(knot, upper), rise), half));
      const auto marked =
          hn::IfThenElse(hn::AndNot(too_dark, trusted), um, hn::Set(d16, kUntrusted));
      if (HWY_LIKELY(x + kLanes <= rows.width)) {
        beyond += hn::CountTrue(d16, too_dark);
        hn::StoreU(marked, d16, depth + x);
      } else {
        const auto inside_row = hn::FirstN(d16, static_cast<size_t>(rows.width - x));
        beyond += hn::CountTrue(d16, hn::And(too_dark, inside_row));
        hn::BlendedStore(marked, inside_row, d16, depth + x);
      }
    }
  }
  return static_cast<int>(beyond);
}
#endif

int GainLutMask(const LutRows& rows, const kernels::LutView& lut) {
#ifdef DTACT_KNOTS_IN_REGISTERS
  if (lut.knots != nullptr && rows.gain_q12 != nullptr) {
    return lut.knots->step_bits == 6 ? GainKnotsMaskRows<6>(rows, lut)
                                     : GainKnotsMaskRows<7>(rows, lut);
  }
#endif
  return rows.gain_q12 == nullptr ? GainLutMaskRows<false>(rows, lut)
                                  : GainLutMaskRows<true>(rows, lut);
}

#undef DTACT_KNOTS_IN_REGISTERS
#endif  // HWY_TARGET == HWY_SCALAR
