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

/// Makes a frame's depth where it differs from the reference image, says what touches and what the
/// map is worth, and chooses how the next map is made. Capture thread only; does not allocate
/// after construction.
class DepthMaker {
 public:
  DepthMaker(const PipelineConfig& config, base::Clock& clock);

  /// From now on this calibration's; null: none. `generation` tells calibrations apart.
  void use(Resolutions* maps, std::uint64_t generation) noexcept;
  /// The reference image is another: follows it. Takes about six frames' time.
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  /// The light on it is. Takes about a frame's time.
  void set_light(double factor) noexcept;

  /// Depth, contact and uncertainty of a frame that `tracker` has just looked at, into buffers
  /// that hold a map of this calibration. `judged`: somebody asks what the map is worth; else its
  /// bend is left out of the uncertainty, unless the resolution is chosen by it or there is a
  /// force.
  void make(const hal::LumaView& luma, const ReferenceTracker& tracker, bool judged,
            DepthFrame& out) noexcept;
  /// No depth is made of this frame: what was known of contact stands, and `out` says nothing.
  void skip(DepthFrame& out, ContactAbsence why) noexcept;

  [[nodiscard]] bool in_contact() const noexcept { return contact_.in_contact(); }
  /// Somewhere in the last frame the image was darker than the LUT reaches.
  [[nodiscard]] bool beyond() const noexcept { return beyond_; }

 private:
  void judge(const Trust& trust, double bend, DepthFrame& out) noexcept;
  [[nodiscard]] bool chooses() const noexcept { return maps_->resolutions().size() > 1; }

  const PipelineConfig& config_;
  base::Clock& clock_;
  Resolutions* maps_ = nullptr;
  std::uint64_t generation_ = 0;
  ContactDetector contact_;
  ResolutionChooser chooser_{0};  ///< Of maps_.
  bool beyond_ = false;
};

}  // namespace dtact::pipeline
