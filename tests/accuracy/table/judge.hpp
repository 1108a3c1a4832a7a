#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "clients/calibrate/fit/published.hpp"
#include "hal/sim/truth.hpp"

namespace dtact::table {

/// Sum of absolute errors over pixels.
struct Error {
  double sum_mm = 0;
  std::size_t pixels = 0;     ///< Number of judged pixels.
  std::size_t untrusted = 0;  ///< Number of untrusted pixels, which are not judged.

  void add(double error_mm) noexcept;
  Error& operator+=(const Error& other) noexcept;
  [[nodiscard]] double mean_mm() const noexcept;  ///< NaN when nothing was judged.
};

/// Error against the sphere that the paper draws: a ball that fills the published circle and is at
/// zero on its edge. Inside the circle only. `depth_um`: the crop.
[[nodiscard]] Error against_circle(std::span<const std::int16_t> depth_um,
                                   const calibration::Circle& circle, double ball_radius_mm);

/// True indentation over the crop at one moment, and where the object is in contact.
struct TruePress {
  std::vector<float> indentation_mm;
  std::vector<std::uint8_t> contact;
};
[[nodiscard]] TruePress true_press(const hal::sim::Truth& truth, std::uint64_t sequence);

/// Error against the simulator's indentation in contact with the ball.
[[nodiscard]] Error against_indentation(std::span<const std::int16_t> depth_um,
                                        const TruePress& press);

}  // namespace dtact::table
