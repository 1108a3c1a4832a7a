// The Gaussian, two rows at a time, in either direction.
// Part of vector_kernels.cpp, which includes it once for each of Highway's targets.

#if HWY_TARGET == HWY_SCALAR

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

#else

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

#endif  // HWY_TARGET == HWY_SCALAR
