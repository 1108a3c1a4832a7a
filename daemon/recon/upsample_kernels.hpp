#pragma once

#include <array>
#include <cstdint>

/// The steps of reading a coarse depth map between its pixels, one row at a time: scalar loops that
/// are the specification, as in kernels.hpp. Depths are within ±16383 micrometres or kUntrusted.
namespace dtact::recon::kernels {

/// Greatest number of fine pixels that lie in a coarse one.
inline constexpr int kMaxPhases = 4;

/// Where the fine pixels of a coarse one lie: beside its middle, towards one of its neighbours.
struct Phases {
  int count = 0;  ///< 2 or 4.
  /// Weight of the neighbour in Q15, 0 … 1/2: the previous one for the first half of the phases,
  /// the next one for the others.
  std::array<std::int16_t, kMaxPhases> share_q15{};
};

/// near + share · (other − near), rounded half up; untrusted where `near` is, `near` where `other`
/// is.
[[nodiscard]] std::int16_t depth_between(std::int16_t near, std::int16_t other,
                                         std::int16_t share_q15) noexcept;

/// `count` coarse pixels to phases.count · `count` fine ones. One more can be read on either side.
void widen_row(const std::int16_t* coarse, const Phases& phases, int count,
               std::int16_t* fine) noexcept;

/// depth_between() of two rows.
void between_row(const std::int16_t* near, const std::int16_t* other, std::int16_t share_q15,
                 int width, std::int16_t* out) noexcept;

}  // namespace dtact::recon::kernels
