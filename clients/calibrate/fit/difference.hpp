#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/model.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// The darkening of every pixel of the depth map, grey levels, positive = darker than untouched.
/// NaN where the light is too weak or the mask forbids. Row-major.
struct DifferenceMap {
  int width = 0;
  int height = 0;
  double mm_per_px = 0;
  std::vector<float> levels;

  [[nodiscard]] float at(int x, int y) const {
    return levels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

/// Gives a model a list that answers with the question: its micrometres are the darkening in Q6.
void answer_darkening(recon::Model& model);

/// What the list of `model` would be asked for: the reconstruction's own rectification, smoothing
/// and gain, to 1/64 of a grey level, averaged over `frames`. The model's method and list play no
/// part. `reference_q8`: the untouched image under the frames' light. Throws std::invalid_argument
/// when sizes disagree or there is no frame.
[[nodiscard]] DifferenceMap smoothed_difference(const recon::Model& model,
                                                std::span<const std::uint16_t> reference_q8,
                                                std::span<const image::Grey8> frames);

/// Reconstructs each frame as a DepthReader does and averages, micrometres; NaN where any was
/// untrusted. Throws std::invalid_argument as above and as the DepthReader's constructor.
[[nodiscard]] std::vector<float> mean_depth_um(const recon::Model& model,
                                               std::span<const std::uint16_t> reference_q8,
                                               std::span<const image::Grey8> frames,
                                               int sharpen_steps = 0);

}  // namespace dtact::calibration
