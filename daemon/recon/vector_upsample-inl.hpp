// A coarse depth map read between its pixels.
// Part of vector_kernels.cpp, which includes it once for each of Highway's targets.

#if HWY_TARGET == HWY_SCALAR

void WidenRow(const int16_t* coarse, const kernels::Phases& phases, int count, int16_t* fine) {
  kernels::widen_row(coarse, phases, count, fine);
}

void BetweenRow(const int16_t* near, const int16_t* other, int16_t share_q15, int width,
                int16_t* out) {
  kernels::between_row(near, other, share_q15, width, out);
}

#else

template <class D16, class V16>
HWY_INLINE V16 DepthBetween(D16 d16, V16 near, V16 other, int16_t share_q15) {
  const auto untrusted = hn::Set(d16, kUntrusted);
  const auto to = hn::IfThenElse(hn::Eq(other, untrusted), near, other);
  const auto um = hn::Add(near, hn::MulFixedPoint15(hn::Sub(to, near), hn::Set(d16, share_q15)));
  return hn::IfThenElse(hn::Eq(near, untrusted), untrusted, um);
}

void WidenRow(const int16_t* coarse, const kernels::Phases& phases, int count, int16_t* fine) {
  const hn::FixedTag<int16_t, kWidenedAtOnce> d8;
  const auto& share = phases.share_q15;
  for (int k = 0; k < count; k += kWidenedAtOnce) {
    const auto before = hn::LoadU(d8, coarse + k - 1);
    const auto here = hn::LoadU(d8, coarse + k);
    const auto next = hn::LoadU(d8, coarse + k + 1);
    int16_t* const out = fine + static_cast<ptrdiff_t>(phases.count) * k;
    if (phases.count == 4) {
      hn::StoreInterleaved4(
          DepthBetween(d8, here, before, share[0]), DepthBetween(d8, here, before, share[1]),
          DepthBetween(d8, here, next, share[2]), DepthBetween(d8, here, next, share[3]), d8, out);
    } else {
      hn::StoreInterleaved2(DepthBetween(d8, here, before, share[0]),
                            DepthBetween(d8, here, next, share[1]), d8, out);
    }
  }
}

void BetweenRow(const int16_t* near, const int16_t* other, int16_t share_q15, int width,
                int16_t* out) {
  const hn::CappedTag<int16_t, kBetweenAtOnce> d16;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d16));
  for (int x = 0; x < width; x += kLanes) {
    const auto um =
        DepthBetween(d16, hn::LoadU(d16, near + x), hn::LoadU(d16, other + x), share_q15);
    if (HWY_LIKELY(x + kLanes <= width)) {
      hn::StoreU(um, d16, out + x);
    } else {
      hn::BlendedStore(um, hn::FirstN(d16, static_cast<size_t>(width - x)), d16, out + x);
    }
  }
}

#endif  // HWY_TARGET == HWY_SCALAR
