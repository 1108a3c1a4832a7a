#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/sim/grid.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// Share of the local light that is lost at an indentation of `d_mm` before it scatters sideways;
/// negative on the bulge.
[[nodiscard]] double response(const OpticsModel& optics, double d_mm) noexcept;

/// Indentation to loss of light, on the grid: the response, then two Gaussian blurs. In integers,
/// with the blurs' weights fixed at construction. One thread at a time.
class Optics {
 public:
  /// Of `layer` only the taper counts; left out: the layer is even.
  Optics(const OpticsModel& optics, const Grid& grid, const LayerModel& layer = {});

  /// `indentation` in 1/Truth::kPerMm, `loss` as Q15 share of the local light; both grid sized.
  /// Outside the grid the layer is as at its border.
  void run(std::span<const std::int16_t> indentation, std::span<std::int16_t> loss) noexcept;

 private:
  /// A separable Gaussian in Q15 on a plane of 16-bit values.
  class Blur {
   public:
    Blur(double sigma, std::size_t width, std::size_t height);
    void run(std::span<const std::int16_t> in, std::span<std::int16_t> out) noexcept;

   private:
    std::size_t width_;
    int height_;
    std::vector<std::int16_t> taps_;  // odd count, sum 2^15
    std::vector<std::int16_t> line_;
    std::vector<std::int32_t> sums_;
    std::vector<std::int16_t> between_;
  };

  void shrink(std::span<const std::int16_t> fine) noexcept;
  void add_wide(std::span<std::int16_t> loss) const noexcept;

  std::size_t width_;
  std::size_t height_;
  std::size_t factor_;  // the wide blur runs on a grid this many times coarser
  std::size_t coarse_width_;
  std::size_t coarse_height_;
  std::int32_t narrow_weight_;           // Q15
  std::vector<std::int16_t> responses_;  // by indentation + 2^15, Q15
  std::vector<std::uint16_t> shares_;    // mean thickness over that at the point, Q12; empty: even
  Blur narrow_;
  Blur wide_;
  std::vector<std::int16_t> sharp_;
  std::vector<std::int16_t> coarse_;
  std::vector<std::int16_t> coarse_blurred_;
};

}  // namespace dtact::hal::sim
