#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/kernel_lut.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::recon {

/// Defines a reconstruction: the scalar kernels, each over the whole image before the next, without
/// strips, rings or tiles. Slow and plain; the daemon's code gives the same bits.
class Specification {
 public:
  explicit Specification(const Model& model, int sharpen_steps = 0);
  void set_reference(std::span<const std::uint16_t> reference_q8);
  /// Depth in micrometres, width × height of the model's table, row-major.
  [[nodiscard]] std::vector<std::int16_t> run(const std::uint8_t* luma, std::ptrdiff_t stride);
  /// Pixels of the last run() that were darker than the LUT covers.
  [[nodiscard]] int beyond() const { return beyond_; }

 private:
  using Plane = std::vector<std::int16_t>;
  [[nodiscard]] std::ptrdiff_t at(int y) const { return std::ptrdiff_t{y} * model_.rectify.width; }
  [[nodiscard]] Plane rectify(std::span<const std::uint16_t> reference_q8) const;
  [[nodiscard]] Plane difference(const std::uint8_t* luma, std::ptrdiff_t stride) const;
  [[nodiscard]] static Plane smooth(const Plane& in, int width, int height,
                                    std::span<const std::int16_t> taps);
  [[nodiscard]] Plane view(const Plane& in, const std::int16_t* gain,
                           const std::uint8_t* untrusted);

  /// One of Van Cittert's steps.
  [[nodiscard]] Plane sharpen(const Plane& level, const Plane& before) const;

  const Model& model_;
  int steps_;
  int width_;
  int height_;
  KernelLut list_;
  Plane reference_q6_;
  Plane gain_q12_;
  std::vector<std::uint8_t> untrusted_;
  int beyond_ = 0;
};

}  // namespace dtact::recon
