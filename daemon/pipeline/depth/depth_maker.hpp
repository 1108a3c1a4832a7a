#pragma once

#include <cstdint>
#include <span>

#include "daemon/pipeline/depth/contact.hpp"
#include "daemon/pipeline/depth/resolutions.hpp"
#include "daemon/pipeline/depth/uncertainty.hpp"
#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/reference/reference_tracker.hpp"
#include "hal/base/clock.hpp"
#include "hal/frame.hpp"

namespace dtact::pipeline {

/// Makes depth where a frame differs from the reference image, detects contact, estimates the
/// uncertainty and chooses the resolution of the next map. Capture thread only; does not allocate
/// after construction.
class DepthMaker {
 public:
  DepthMaker(const PipelineConfig& config, base::Clock& clock);

  /// Switches to this calibration; null: none. `generation` identifies the calibration.
  void use(Resolutions* maps, std::uint64_t generation) noexcept;
  /// A new reference image is in use. Takes about six frames' time.
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  /// The light has changed by `factor`. Takes about a frame's time.
  void set_light(double factor) noexcept;

  /// Writes depth, contact and uncertainty of the frame that `tracker` last looked at to buffers
  /// that hold a map of this calibration. `judged`: a client wants the uncertainty. Without it the
  /// uncertainty leaves out the bend, unless the bend chooses the resolution or the force needs
  /// it.
  void make(const hal::LumaView& luma, const ReferenceTracker& tracker, bool judged,
            DepthFrame& out) noexcept;
  /// Makes no depth of this frame: `out` reports no contact. The contact state stays unless nobody
  /// asks for it.
  void skip(DepthFrame& out, ContactAbsence why) noexcept;

  [[nodiscard]] bool in_contact() const noexcept { return contact_.in_contact(); }
  /// The last frame was somewhere darker than the LUT covers.
  [[nodiscard]] bool beyond() const noexcept { return beyond_; }

 private:
  void judge(const Trust& trust, double bend, DepthFrame& out) noexcept;
  [[nodiscard]] bool chooses() const noexcept { return maps_->resolutions().size() > 1; }

  const PipelineConfig& config_;
  base::Clock& clock_;
  Resolutions* maps_ = nullptr;
  std::uint64_t generation_ = 0;
  ContactDetector contact_;
  ResolutionChooser chooser_{0};  ///< chooses among maps_
  bool beyond_ = false;
};

}  // namespace dtact::pipeline
