#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/sim/grid.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// Share of the local light that is lost at an indentation of `d_mm` before it scatters sideways;
/// negative on the bulge. The thickness counts where the response is given by knots.
[[nodiscard]] double response(const OpticsModel& optics, double d_mm,
                              double thickness_mm = 0) noexcept;

/// Indentation to loss of light, on the grid: the response, then a sum of Gaussian blurs. Uses
/// integers, with the blurs' weights fixed at construction. One thread at a time.
///
/// Where the blurs' widths follow the local thickness, every point's loss is divided between a
/// few thicknesses, linearly between the two nearest. Each of them is blurred by its own
/// widths.
class Optics {
 public:
  /// Uses the taper of `gel` and, with knots or growth, its thickness; default: an even gel.
  Optics(const OpticsModel& optics, const Grid& grid, const GelModel& gel = {});

  /// `indentation` in 1/Truth::kPerMm, `loss` as Q15 share of the local light; both grid sized.
  /// Outside the grid the gel is as at its border.
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

  /// What of the loss is scattered by the same widths.
  struct Part {
    std::vector<std::int16_t> responses;  // by indentation + 2^15, Q15
    Blur narrow;
    Blur wide;
    Blur far;
  };

  void scatter(Part& part, std::span<const std::int16_t> indentation,
               std::span<std::int16_t> loss) noexcept;
  void shrink(std::span<const std::int16_t> fine) noexcept;
  void add_wide(std::span<std::int16_t> loss) const noexcept;

  std::size_t width_;
  std::size_t height_;
  std::size_t factor_;  // the wide and the far blur run on a grid this many times coarser
  std::size_t coarse_width_;
  std::size_t coarse_height_;
  std::int32_t narrow_weight_;         // Q15
  std::int32_t far_weight_;            // of what is not narrow, Q15
  std::vector<std::uint16_t> shares_;  // mean thickness over that at the point, Q12; empty: even
  std::vector<Part> parts_;            // one, unless the widths follow the thickness
  std::vector<std::int16_t> sharp_;
  std::vector<std::int16_t> one_;  // loss of one part of several
  std::vector<std::int16_t> coarse_;
  std::vector<std::int16_t> coarse_blurred_;
  std::vector<std::int16_t> coarse_far_;
};

}  // namespace dtact::hal::sim
