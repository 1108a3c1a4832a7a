#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/upsampler.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// The darkening (reference − frame) of every pixel of the depth map, grey levels.
/// NaN where the light is too weak or the mask forbids. Row-major.
struct DarkeningMap {
  int width = 0;
  int height = 0;
  double mm_per_px = 0;
  std::vector<float> levels;

  [[nodiscard]] float at(int x, int y) const {
    return levels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

/// Gives a model an identity LUT: its micrometres are the darkening in Q6.
void answer_darkening(recon::Model& model);

/// The input of the LUT of `model`: the reconstruction's own rectification, smoothing
/// and gain, to 1/64 of a grey level, averaged over `frames`. The model's method and LUT are not
/// used. `reference_q8` is the reference image under the frames' light. Throws
/// std::invalid_argument when sizes disagree or without frames.
[[nodiscard]] DarkeningMap smoothed_darkening(const recon::Model& model,
                                              std::span<const std::uint16_t> reference_q8,
                                              std::span<const image::Grey8> frames);

/// Reconstructs each frame with a DepthReader and averages, micrometres; NaN where any was
/// untrusted. Throws std::invalid_argument as above and like the DepthReader's constructor.
[[nodiscard]] std::vector<float> mean_depth_um(const recon::Model& model,
                                               std::span<const std::uint16_t> reference_q8,
                                               std::span<const image::Grey8> frames,
                                               int sharpen_steps = 0);

/// Reconstructs frames on the calibration's map like the daemon: plain at full resolution,
/// sharpened at recon::kSharpenedAt and interpolated.
class DepthReader {
 public:
  /// Throws std::invalid_argument like the Reconstructor's constructor.
  explicit DepthReader(const std::shared_ptr<const recon::Model>& model, int sharpen_steps = 0);

  /// See Reconstructor::set_reference().
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
    reconstructor_.set_reference(reference_q8);
  }
  /// Indentation, micrometres, kUntrusted where untrusted; valid until the next call. The frame has
  /// the size of the calibration's.
  [[nodiscard]] std::span<const std::int16_t> read(const image::Grey8& frame);

 private:
  recon::Reconstructor reconstructor_;
  std::optional<recon::Upsampler> upsampler_;
  std::vector<std::uint8_t> luma_;  // padded
  std::vector<std::int16_t> made_um_;
  std::vector<std::int16_t> fine_um_;
};

}  // namespace dtact::calibration
