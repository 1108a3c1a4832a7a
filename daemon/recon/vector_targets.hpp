#pragma once

// Which of Highway's targets the kernels are built for. Included before Highway itself, by the
// tests too: a target that they do not know would not be run, one that is not built would be
// awaited.

/// AVX-512 as of Ice Lake and Zen 4, which Highway leaves out unless asked for.
#define HWY_WANT_AVX3_DL
/// The kernels shuffle and interleave within 128 bits, which scalable vectors leave open.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
