// What a depth map adds up to.
// Part of vector_kernels.cpp, which includes it once for each of Highway's targets.

#if HWY_TARGET == HWY_SCALAR

void SumRows(const int16_t* depth_um, std::ptrdiff_t stride, int x0, int x1, int y0, int y1,
             DepthSums& sums) {
  for (int y = y0; y < y1; ++y) kernels::sum_row(depth_um + y * stride, y, x0, x1, sums);
}

void BendRow(const int16_t* row_um, std::ptrdiff_t stride, int x0, int x1, DepthSums& sums) {
  kernels::bend_row(row_um, stride, x0, x1, sums);
}

#else

/// Calls visit(x, pixels) for [x0, x1), at least a vector wide, a vector at a time. The last one
/// begins early; what it sees a second time is kUntrusted, which counts for nothing.
template <class D16, class Visit>
HWY_INLINE void ForEachVector(D16 d16, const int16_t* row, int x0, int x1, Visit visit) {
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(D16()));
  int x = x0;
  for (; x + kLanes <= x1; x += kLanes) visit(x, hn::LoadU(d16, row + x));
  if (x == x1) return;
  const auto seen = hn::FirstN(d16, static_cast<size_t>(kLanes - (x1 - x)));
  x = x1 - kLanes;
  visit(x, hn::IfThenElse(seen, hn::Set(d16, kUntrusted), hn::LoadU(d16, row + x)));
}

/// Looks for the deepest in a vector of pixels from column `x` on, where some are as deep as the
/// deepest so far.
template <class D16, class V16>
HWY_NOINLINE void FindDeepest(D16 d16, V16 um, int x, int y, DepthSums& sums) {
  const int16_t deepest = hn::GetLane(hn::MaxOfLanes(d16, um));
  const auto first =
      x + static_cast<int>(hn::FindFirstTrue(d16, hn::Eq(um, hn::Set(d16, deepest))));
  const bool earlier = y < sums.deepest_y || (y == sums.deepest_y && first < sums.deepest_x);
  if (deepest == sums.deepest_um && !earlier) return;
  sums.deepest_um = deepest;
  sums.deepest_x = first;
  sums.deepest_y = y;
}

/// Columns are counted from this one of a part.
constexpr int kMiddle = 256;

/// Adds up the pixels [x0, x1) of one row: few enough columns that sums of depth times column are
/// int32. With the squares of an even row.
template <bool kSquares, class D16>
HWY_INLINE void SumRowPart(D16 d16, const int16_t* row, int y, int x0, int x1, DepthSums& sums) {
  using V16 = hn::VFromD<D16>;
  const hn::RepartitionToWide<D16> d32;
  const V16 threshold_um = hn::Set(d16, sums.rules.threshold_um);
  const V16 release_um = hn::Set(d16, sums.rules.release_um);
  const V16 one = hn::Set(d16, 1);
  const V16 columns = hn::Iota(d16, 0);
  const V16 low = hn::Min(threshold_um, release_um);
  // Most pixels of most maps are shallower than this and leave nothing to be done.
  const auto ignored = [&] {
    const auto below = static_cast<int16_t>(HWY_MAX(sums.deepest_um - 1, int{kUntrusted}));
    return hn::Min(low, hn::Set(d16, below));
  };
  V16 shallow = ignored();
  PairSum<decltype(d32)> um{d32};
  PairSum<decltype(d32)> um_x{d32};
  PairSum<decltype(d32)> square{d32};
  PairSum<decltype(d32)> square_x{d32};
  size_t made = 0;
  size_t lost = 0;
  ForEachVector(d16, row, x0, x1, [&](int x, V16 pixels) HWY_ATTR {
    if (HWY_LIKELY(hn::AllFalse(d16, hn::Gt(pixels, shallow)))) return;
    lost += hn::CountTrue(d16, hn::Gt(pixels, release_um));
    const auto pressed = hn::Gt(pixels, threshold_um);
    made += hn::CountTrue(d16, pressed);
    const V16 depth = hn::IfThenElseZero(pressed, pixels);
    const V16 column = hn::Add(columns, hn::Set(d16, static_cast<int16_t>(x - x0 - kMiddle)));
    um.Add(depth, one);
    um_x.Add(depth, column);
    if constexpr (kSquares) {
      const V16 twice = hn::Add(depth, depth);
      const V16 squared = hn::MulFixedPoint15(twice, twice);
      square.Add(squared, one);
      square_x.Add(squared, column);
    }
    const auto below =
        hn::Set(d16, static_cast<int16_t>(HWY_MAX(sums.deepest_um - 1, int{kUntrusted})));
    if (HWY_UNLIKELY(!hn::AllFalse(d16, hn::Gt(pixels, below)))) {
      FindDeepest(d16, pixels, x, y, sums);
      shallow = ignored();
    }
  });
  sums.lost += static_cast<std::int64_t>(lost);
  if (made == 0) return;
  sums.made += static_cast<std::int64_t>(made);
  const std::int64_t part_um = hn::GetLane(hn::SumOfLanes(d32, um.Total()));
  const std::int64_t part_um_x = hn::GetLane(hn::SumOfLanes(d32, um_x.Total()));
  sums.um += part_um;
  sums.um_x += part_um_x + part_um * (x0 + kMiddle);
  sums.um_y += part_um * y;
  if constexpr (!kSquares) return;
  const std::int64_t part_square = hn::GetLane(hn::SumOfLanes(d32, square.Total()));
  const std::int64_t part_square_x = hn::GetLane(hn::SumOfLanes(d32, square_x.Total()));
  sums.square += part_square;
  sums.square_x += part_square_x + part_square * (x0 + kMiddle);
  sums.square_y += part_square * y;
}

void SumRows(const int16_t* depth_um, std::ptrdiff_t stride, int x0, int x1, int y0, int y1,
             DepthSums& sums) {
  const hn::CappedTag<int16_t, kBlock> d16;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d16));
  // 32764, the largest square, × (0 + 1 + … + 256), columns being counted from the middle, is less
  // than 2³¹.
  constexpr int kPart = 2 * kMiddle;
  for (int y = y0; y < y1; ++y) {
    const int16_t* const row = depth_um + y * stride;
    for (int x = x0; x < x1; x += kPart) {
      const int end = HWY_MIN(x + kPart, x1);
      if (end - x < kLanes) {
        kernels::sum_row(row, y, x, end, sums);
      } else if (y % 2 == 0) {
        SumRowPart<true>(d16, row, y, x, end, sums);
      } else {
        SumRowPart<false>(d16, row, y, x, end, sums);
      }
    }
  }
}

void BendRow(const int16_t* row_um, std::ptrdiff_t stride, int x0, int x1, DepthSums& sums) {
  const hn::CappedTag<int16_t, kBlock> d16;
  using V16 = hn::VFromD<decltype(d16)>;
  const hn::RepartitionToWide<decltype(d16)> d32;
  if (x1 - x0 < static_cast<int>(hn::MaxLanes(d16))) {
    kernels::bend_row(row_um, stride, x0, x1, sums);
    return;
  }
  const int reach = sums.rules.bend_reach;
  const std::ptrdiff_t below = reach * stride;
  const V16 from = hn::Set(d16, sums.rules.bend_from_um);
  const V16 one = hn::Set(d16, 1);
  const V16 zero = hn::Zero(d16);
  PairSum<decltype(d32)> sum{d32};
  size_t bent = 0;
  ForEachVector(d16, row_um, x0, x1, [&](int x, V16 pixels) HWY_ATTR {
    const auto pressed = hn::Gt(pixels, from);
    if (HWY_LIKELY(hn::AllFalse(d16, pressed))) return;
    const int16_t* const at = row_um + x;
    const V16 left = hn::LoadU(d16, at - reach);
    const V16 right = hn::LoadU(d16, at + reach);
    const V16 up = hn::LoadU(d16, at - below);
    const V16 down = hn::LoadU(d16, at + below);
    const V16 least = hn::Min(hn::Min(left, right), hn::Min(up, down));
    const auto counts = hn::And(pressed, hn::Ne(least, hn::Set(d16, kUntrusted)));
    bent += hn::CountTrue(d16, counts);
    // Differences of what counts fit: depth lies within ±16383.
    const V16 across = hn::SaturatedAdd(hn::Sub(left, pixels), hn::Sub(right, pixels));
    const V16 along = hn::SaturatedAdd(hn::Sub(up, pixels), hn::Sub(down, pixels));
    const V16 bend = hn::SaturatedAdd(across, along);
    sum.Add(hn::IfThenElseZero(counts, hn::Max(bend, hn::SaturatedSub(zero, bend))), one);
  });
  sums.bent += static_cast<std::int64_t>(bent);
  sums.bend_um += hn::GetLane(hn::SumOfLanes(d32, sum.Total()));
}

#endif  // HWY_TARGET == HWY_SCALAR
