#pragma once

#include <memory>
#include <string>

#include "daemon/calibration/calibration.hpp"
#include "daemon/pipeline/reference/cells.hpp"
#include "daemon/pipeline/reference/gel_marks.hpp"
#include "daemon/pipeline/reference/luma_grid.hpp"
#include "hal/light_ring.hpp"

namespace dtact::pipeline {

/// Throws std::invalid_argument with the fix when a calibration covers too little of the frame to
/// distinguish light changes from contact. `name`: the calibration's, for the message.
void require_coverage(const recon::RectifyTable& table, const std::string& name);

/// What a calibration says of the reference image, with the memory to compare frames with it: made
/// on the network's side, used on the capture thread.
struct CalibratedImage {
  /// Throws like require_coverage().
  explicit CalibratedImage(std::shared_ptr<const calibration::Calibration> of);

  std::shared_ptr<const calibration::Calibration> calibration;
  LumaGrid grid;      ///< The calibration's reference at low resolution.
  CellRegion region;  ///< Cells that lie wholly in the calibrated part of the frame.
  Cells cells;
  std::shared_ptr<const GelMarks> marks;  ///< The gel's marks within the region.
};

/// The ring emits another light than at calibration: any channel, after brightness and gamma, off
/// by more than one step. False when the calibration did not record its light. Does not allocate.
[[nodiscard]] bool light_differs(const calibration::Calibration& calibration,
                                 const hal::Light& light) noexcept;

}  // namespace dtact::pipeline
