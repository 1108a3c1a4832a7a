#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/upsampler.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {

/// Frames to depth on the calibration's map, as the daemon makes it: plain at full resolution,
/// sharpened at recon::kSharpenedAt and interpolated.
class DepthReader {
 public:
  /// Throws std::invalid_argument as the Reconstructor's constructor.
  explicit DepthReader(const std::shared_ptr<const recon::Model>& model, int sharpen_steps = 0);

  /// As Reconstructor::set_reference().
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
    reconstructor_.set_reference(reference_q8);
  }
  /// Indentation, micrometres, kUntrusted where it is none; of the last frame only, which has the
  /// size of the calibration's.
  [[nodiscard]] std::span<const std::int16_t> read(const image::Grey8& frame);

 private:
  recon::Reconstructor reconstructor_;
  std::optional<recon::Upsampler> upsampler_;
  std::vector<std::uint8_t> luma_;  // padded
  std::vector<std::int16_t> made_um_;
  std::vector<std::int16_t> fine_um_;
};

}  // namespace dtact::calibration
