// Van Cittert's filter.
// Part of vector_kernels.cpp, which includes it once for each of Highway's targets.

#if HWY_TARGET == HWY_SCALAR

void LitRow(const int16_t* difference_q6, const int16_t* gain_q12, int first, int last,
            int16_t* level_q6) {
  const int x = first * kBlock;
  kernels::lit_row(difference_q6 + x, gain_q12 + x, (last - first) * kBlock, level_q6 + x);
}

void ShrinkRow(const int16_t* const* rows, int first, int last, int16_t* coarse) {
  const int x = first * kBlock;
  const int16_t* from[kernels::kCoarse];
  for (int i = 0; i < kernels::kCoarse; ++i) from[i] = rows[i] + x;
  kernels::shrink_row(from, (last - first) * kBlock / kernels::kCoarse,
                      coarse + x / kernels::kCoarse);
}

void SharpenRow(const SharpenRows& rows, int16_t wide_share_q15, int first, int last,
                int16_t* after) {
  const int x = first * kBlock;
  const int k = x / kernels::kCoarse;
  kernels::sharpen_row(rows.level + x, rows.before + x, rows.narrow + x,
                       {rows.wide.near + k, rows.wide.other + k, rows.wide.other_q15},
                       wide_share_q15, (last - first) * kBlock, after + x);
}

#else

template <class D16, class V16>
HWY_INLINE V16 Clamped(D16 d16, V16 level) {
  const auto most = hn::Set(d16, int16_t{kernels::kSmoothable});
  return hn::Max(hn::Min(level, most), hn::Neg(most));
}

void LitRow(const int16_t* difference_q6, const int16_t* gain_q12, int first, int last,
            int16_t* level_q6) {
  const hn::CappedTag<int16_t, kBlock> d16;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d16));
  const auto one = hn::Set(d16, int16_t{kernels::kGainOne});
  for (int x = first * kBlock; x < last * kBlock; x += kLanes) {
    const auto gain = hn::LoadU(d16, gain_q12 + x);
    const auto used = hn::IfThenElse(hn::Eq(gain, hn::Zero(d16)), one, gain);
    const auto lit = Lit(d16, hn::LoadU(d16, difference_q6 + x), used);
    hn::StoreU(Clamped(d16, lit), d16, level_q6 + x);
  }
}

void ShrinkRow(const int16_t* const* rows, int first, int last, int16_t* coarse) {
  const hn::FixedTag<int16_t, 8> d16;
  const hn::FixedTag<int32_t, 4> d32;
  const hn::FixedTag<int16_t, 4> d16_half;
  const auto ones = hn::Set(d16, int16_t{1});
  constexpr int kAtOnce = 4 * kernels::kCoarse;
  for (int x = first * kBlock; x < last * kBlock; x += kAtOnce) {
    PairSum<decltype(d32)> left{d32}, right{d32};
    for (int i = 0; i < kernels::kCoarse; ++i) {
      left.Add(hn::LoadU(d16, rows[i] + x), ones);
      right.Add(hn::LoadU(d16, rows[i] + x + 8), ones);
    }
    const auto low = left.Total();
    const auto high = right.Total();
    const auto sum = hn::Add(hn::ConcatEven(d32, high, low), hn::ConcatOdd(d32, high, low));
    const auto mean = hn::ShiftRight<4>(hn::Add(sum, hn::Set(d32, 8)));
    hn::StoreU(hn::DemoteTo(d16_half, mean), d16_half, coarse + x / kernels::kCoarse);
  }
}

template <class V16>
HWY_INLINE V16 Between(V16 from, V16 to, V16 share_q15) {
  return hn::Add(from, hn::MulFixedPoint15(hn::Sub(to, from), share_q15));
}

void SharpenRow(const SharpenRows& rows, int16_t wide_share_q15, int first, int last,
                int16_t* after) {
  const hn::CappedTag<int16_t, kBlock> d16;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d16));
  // Eight coarse values make a block of 32.
  const hn::FixedTag<int16_t, 8> d8;
  static_assert(8 * kernels::kCoarse == kBlock);
  const auto down_share = hn::Set(d8, rows.wide.other_q15);
  const auto near_share = hn::Set(d8, kernels::kEighth);
  const auto far_share = hn::Set(d8, int16_t{3 * kernels::kEighth});
  const auto wide_share = hn::Set(d16, wide_share_q15);
  const auto down = [&](int k) HWY_ATTR {
    return Between(hn::LoadU(d8, rows.wide.near + k), hn::LoadU(d8, rows.wide.other + k),
                   down_share);
  };
  constexpr int kChunk = 8;  // blocks
  HWY_ALIGN int16_t wide[kChunk * kBlock];
  for (int begin = first; begin < last; begin += kChunk) {
    const int end = HWY_MIN(begin + kChunk, last);
    for (int block = begin; block < end; ++block) {
      const auto before = down(8 * block - 1);
      const auto here = down(8 * block);
      const auto next = down(8 * block + 1);
      hn::StoreInterleaved4(Between(here, before, far_share), Between(here, before, near_share),
                            Between(here, next, near_share), Between(here, next, far_share), d8,
                            wide + static_cast<ptrdiff_t>(block - begin) * kBlock);
    }
    for (int x = begin * kBlock; x < end * kBlock; x += kLanes) {
      const auto mean = hn::Load(d16, wide + (x - begin * kBlock));
      const auto scattered = Between(hn::LoadU(d16, rows.narrow + x), mean, wide_share);
      const auto change = hn::Sub(hn::LoadU(d16, rows.level + x), scattered);
      const auto sum = hn::SaturatedAdd(hn::LoadU(d16, rows.before + x), change);
      hn::StoreU(Clamped(d16, sum), d16, after + x);
    }
  }
}

#endif  // HWY_TARGET == HWY_SCALAR
