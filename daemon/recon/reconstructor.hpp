#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "daemon/recon/depth_sums.hpp"
#include "daemon/recon/model.hpp"
#include "daemon/recon/tiles.hpp"

namespace dtact::recon {

/// Nanoseconds of each step of one reconstruction.
struct StepTimes {
  std::int64_t rectify_ns = 0;  ///< Rectify and difference.
  std::int64_t smooth_ns = 0;   ///< And sharpen.
  std::int64_t lut_ns = 0;      ///< Gain, LUT, untrusted mark.
  std::int64_t sums_ns = 0;     ///< DepthSums; run_active() only.
};

/// What a depth buffer holds besides the reference map: kept beside each buffer that run_active()
/// writes, so that only formerly active tiles are cleared. Starts as "anything at all".
struct DrawnTiles {
  TileRows tiles;
  std::uint64_t rest = 0;  ///< Which reference map lies outside the tiles; 0: none.
};

/// Bytes that must be readable after the last pixel of a luma image, for vector loads. The HAL's
/// frames have as many (hal::kLumaPadding).
inline constexpr std::size_t kLumaPadding = 64;

/// By how many steps a calibration's levels can be sharpened, ascending: those that it has LUTs
/// for; none where its light is scattered wider than the filter reaches. `model`: not
/// decimated.
[[nodiscard]] std::vector<int> sharpening_steps(const Model& model);

/// Turns luma into depth, in fixed point (formats and ranges in kernels.hpp: Q6 luma, Q12 gain,
/// int16 micrometres). Holds its scratch rows, so run() never allocates. One thread at a time.
class Reconstructor {
 public:
  /// `sharpen_steps` 1 or 2: levels are sharpened by this number of steps (sharpener.hpp), and the
  /// model's LUT for it is used. Throws std::invalid_argument when the model's parts disagree in
  /// size, it has no such LUT or its scattering is too wide for its map.
  explicit Reconstructor(std::shared_ptr<const Model> model, int sharpen_steps = 0);
  ~Reconstructor();
  Reconstructor(Reconstructor&&) noexcept;
  Reconstructor& operator=(Reconstructor&&) noexcept;

  [[nodiscard]] const Model& model() const noexcept;
  [[nodiscard]] int sharpen_steps() const noexcept;

  /// Takes the reference image under the present light: frame sized, Q8 luma, row-major without
  /// padding. Until then the model's own reference is used. Does not allocate, and takes about as
  /// long as six frames: call it between frames.
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;

  /// The light has changed by a factor since set_reference(), 0.6 … 1.6: from now on as if the
  /// reference had been taken in it, within one unit of Q6 (0.5 µm) and of the gain. Replaces an
  /// earlier factor; the reference map does not change. Method::published subtracts whole levels
  /// and goes on as it is. Does not allocate, and takes about as long as a frame.
  void set_light(double factor) noexcept;

  /// `luma`: frame sized, rows `stride` bytes apart, kLumaPadding bytes readable after the last
  /// pixel. `depth_um`: width × height of the model's table, row-major. Borders are replicated when
  /// smoothing. Beyond the LUT's covered range on the deep side Method::lut writes kUntrusted. Both
  /// methods do so where the mask says so and where either reference is darker than eight grey
  /// levels or the light less than an eighth of the calibration's.
  void run(const std::uint8_t* luma, std::ptrdiff_t stride, std::span<std::int16_t> depth_um,
           StepTimes* times = nullptr) noexcept;

  /// The same in some tiles of grid() only (TileReaders says which depend on what has changed):
  /// those hold what run() gives, bit for bit. Everywhere else `depth_um` is 0, or kUntrusted where
  /// the mask or the light say so. `drawn` belongs to this buffer. Method::published is computed in
  /// full. Allocates when `drawn` is of another map, i.e. the first time. What is computed is added
  /// to `sums`, by its rules.
  void run_active(const std::uint8_t* luma, std::ptrdiff_t stride, const TileRows& tiles,
                  std::span<std::int16_t> depth_um, DrawnTiles& drawn, StepTimes* times = nullptr,
                  DepthSums* sums = nullptr) noexcept;

  [[nodiscard]] const TileGrid& grid() const noexcept;
  /// How many pixels of the map a result depends on, on every side.
  [[nodiscard]] int radius() const noexcept;

  /// Pixels of the last run() or run_active() that were darker than the LUT covers, masked ones
  /// not counted.
  [[nodiscard]] int beyond_pixels() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::recon
