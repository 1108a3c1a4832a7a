#include "daemon/recon/upsample_kernels.hpp"

#include "daemon/recon/model.hpp"

namespace dtact::recon::kernels {

std::int16_t depth_between(std::int16_t near, std::int16_t other, std::int16_t share_q15) noexcept {
  if (near == kUntrusted) return kUntrusted;
  const std::int32_t from = near;
  const std::int32_t to = other == kUntrusted ? near : other;
  return static_cast<std::int16_t>(from + (((to - from) * share_q15 + (1 << 14)) >> 15));
}

void widen_row(const std::int16_t* coarse, const Phases& phases, int count,
               std::int16_t* fine) noexcept {
  for (int k = 0; k < count; ++k) {
    for (int phase = 0; phase < phases.count; ++phase) {
      const std::int16_t other = coarse[2 * phase < phases.count ? k - 1 : k + 1];
      fine[phases.count * k + phase] =
          depth_between(coarse[k], other, phases.share_q15[static_cast<std::size_t>(phase)]);
    }
  }
}

void between_row(const std::int16_t* near, const std::int16_t* other, std::int16_t share_q15,
                 int width, std::int16_t* out) noexcept {
  for (int x = 0; x < width; ++x) out[x] = depth_between(near[x], other[x], share_q15);
}

}  // namespace dtact::recon::kernels
