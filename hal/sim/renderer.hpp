#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "hal/files/png.hpp"
#include "hal/sim/light_field.hpp"
#include "hal/sim/noise.hpp"
#include "hal/sim/optics.hpp"
#include "hal/sim/truth.hpp"

namespace dtact::hal::sim {

/// Makes the frames of a scene, without a clock, threads or faults: bytes are a function of scene,
/// seed, sequence, light and gain. What did not change since the last frame is not computed again;
/// noise always is. Does not allocate after construction. One thread at a time.
class Renderer {
 public:
  /// Solves the scene's contacts. Throws std::runtime_error as Truth does.
  Renderer(const Scene& scene, std::uint64_t seed);
  /// The same presses under the camera, optics and light of `scene`, whose camera mode and gel
  /// must be the truth's: contact is solved once for many lights.
  Renderer(std::shared_ptr<const Truth> truth, const Scene& scene, std::uint64_t seed);

  /// Multiplies the exposure of the scene's frames from now on, 0.25 … 4.
  void set_gain(double gain) noexcept;

  /// Frame `sequence` in full-range luma: the first `rows` rows, `stride` bytes apart.
  void render(std::uint64_t sequence, const LedLevels& light, std::uint8_t* luma,
              std::ptrdiff_t stride, int rows) noexcept;

  /// The image of that frame before noise and rounding, Q6, row-major. Valid until the next call.
  [[nodiscard]] std::span<const std::uint16_t> render_clean(std::uint64_t sequence,
                                                            const LedLevels& light) noexcept;

  [[nodiscard]] const Truth& truth() const noexcept { return *truth_; }

 private:
  void update(std::uint64_t sequence, const LedLevels& light, int rows) noexcept;
  void expose(int rows) noexcept;

  std::shared_ptr<const Truth> truth_;
  Perspective perspective_;
  Optics optics_;
  LightField field_;
  Noise noise_;
  std::vector<std::uint16_t> tone_;  // linear Q6 → grey Q6: the camera's gamma and clipping

  Truth::Moment moment_{-1, -1, 0};  // what indentation_ and loss_ belong to
  LedLevels levels_{};               // what light_ belongs to
  bool lit_ = false;
  std::uint32_t gain_q12_ = 4096;
  int exposed_rows_ = 0;  // rows of grey_ that are up to date
  std::vector<std::int16_t> indentation_;
  std::vector<std::int16_t> loss_;
  std::vector<std::int16_t> seen_loss_;
  std::vector<std::int16_t> loss_row_;
  std::vector<std::uint16_t> light_;
  std::vector<std::uint16_t> grey_;  // the image without noise, Q6
  std::vector<std::int16_t> amplitude_;
};

/// One frame on its own, for tests: solves the scene every time.
[[nodiscard]] image::Grey8 render_frame(const Scene& scene, std::uint64_t sequence,
                                        const Light& light, std::uint64_t seed);

}  // namespace dtact::hal::sim
