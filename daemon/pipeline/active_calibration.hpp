#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "daemon/pipeline/luma_grid.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "hal/camera.hpp"
#include "hal/light_ring.hpp"

namespace dtact::pipeline {

/// A calibration ready for the capture thread: all that takes memory or time is done. Made and
/// freed on the network's side, used on the capture thread.
struct ActiveCalibration {
  std::shared_ptr<const calibration::Calibration> calibration;
  /// One for each resolution that may be asked for, the coarser after the finer.
  std::vector<recon::Reconstructor> reconstructors;
  std::size_t in_use = 0;  ///< Index of the one that works on the next frame.
  LumaGrid grid;           ///< Of the calibration's reference.
  CellRegion region;       ///< Cells that lie wholly in the calibrated part of the frame.
  bool camera_mismatch = false;
  std::uint64_t generation = 0;  ///< Counts the calibrations of this run.

  [[nodiscard]] recon::Reconstructor& reconstructor() noexcept { return reconstructors[in_use]; }
  [[nodiscard]] const recon::Reconstructor& reconstructor() const noexcept {
    return reconstructors[in_use];
  }
  /// What the list is uncertain by at an indentation, micrometres: as the calibration says, else
  /// kUnstatedListUm.
  [[nodiscard]] double list_um(double depth_mm) const noexcept;
  /// What a light that differs from the reference's by `share` adds to or takes off every
  /// indentation, micrometres.
  [[nodiscard]] double light_um(double share) const noexcept;
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  /// The light is the reference's times `factor`.
  void set_light(double factor) noexcept;
  /// From the next frame on the map has 1/`decimation` of the resolution, where there is one such.
  void use_decimation(int decimation) noexcept;
};

/// Throws std::invalid_argument, saying what to do, when the calibration cannot be used with frames
/// of this camera at all (other differences are a health condition).
[[nodiscard]] std::unique_ptr<ActiveCalibration> activate(
    const std::shared_ptr<const calibration::Calibration>& calibration,
    const hal::CameraInfo& camera, const ReconstructionRules& rules);

/// The camera, its mode or its controls are not those of the calibration.
[[nodiscard]] bool camera_differs(const calibration::Calibration& calibration,
                                  const hal::CameraInfo& camera);

/// The ring shows another light than at calibration: any channel, after brightness, off by more
/// than one step. False when the calibration did not record its light. Does not allocate.
[[nodiscard]] bool light_differs(const calibration::Calibration& calibration,
                                 const hal::Light& light) noexcept;

}  // namespace dtact::pipeline
