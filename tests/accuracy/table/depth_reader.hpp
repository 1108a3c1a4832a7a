#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/upsampler.hpp"
#include "hal/image/png.hpp"

namespace dtact::table {

/// Frames to depth on the calibration's map, as the daemon makes it: plain at full resolution,
/// sharpened at a quarter and interpolated.
class DepthReader {
 public:
  explicit DepthReader(const std::shared_ptr<const recon::Model>& model, int sharpen_steps = 0);

  /// Indentation, micrometres, kUntrusted where it is none; of the last frame only.
  [[nodiscard]] std::span<const std::int16_t> read(const image::Grey8& frame);

 private:
  recon::Reconstructor reconstructor_;
  std::optional<recon::Upsampler> upsampler_;
  std::vector<std::uint8_t> luma_;  // padded
  std::vector<std::int16_t> made_um_;
  std::vector<std::int16_t> fine_um_;
};

}  // namespace dtact::table
