#pragma once

#include <cstdint>

#include "daemon/recon/upsample_kernels.hpp"

/// The scalar kernels of upsample_kernels.hpp with the machine's vector instructions: same bits.
namespace dtact::recon::vec {

/// Coarse pixels that are widened together.
inline constexpr int kWidenedAtOnce = 8;
/// Fine pixels that are read together.
inline constexpr int kBetweenAtOnce = 32;

/// kernels::widen_row of `count` coarse pixels, a multiple of kWidenedAtOnce.
void widen_row(const std::int16_t* coarse, const kernels::Phases& phases, int count,
               std::int16_t* fine) noexcept;

/// kernels::between_row. `width` values are written, inputs are read in whole kBetweenAtOnce.
void between_row(const std::int16_t* near, const std::int16_t* other, std::int16_t share_q15,
                 int width, std::int16_t* out) noexcept;

}  // namespace dtact::recon::vec
