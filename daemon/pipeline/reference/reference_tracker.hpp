#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "daemon/pipeline/health.hpp"
#include "daemon/pipeline/light_timeline.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/reference/calibrated_image.hpp"
#include "daemon/pipeline/reference/camera_shift_detector.hpp"
#include "daemon/pipeline/reference/image_watch.hpp"
#include "daemon/pipeline/reference/light_follower.hpp"
#include "daemon/pipeline/reference/reference_keeper.hpp"
#include "daemon/pipeline/reference/reference_writer.hpp"
#include "hal/frame.hpp"
#include "hal/light_ring.hpp"

namespace dtact::pipeline {

/// When and how a frame was taken, as far as the reference image is concerned.
struct FrameState {
  std::int64_t timestamp_ns = 0;  ///< The frame's own, CLOCK_MONOTONIC.
  std::int64_t now_ns = 0;        ///< CLOCK_MONOTONIC.
  bool settled = false;           ///< It shows only the present light, no earlier one.
  bool whole = false;             ///< All of it was decoded, not only what the map reads.
};

/// The result of a look at a frame.
struct Observation {
  bool measurable = false;     ///< Depth can be measured in this frame, against reference().
  bool new_reference = false;  ///< reference() is another from this frame on, and light() is 1.
  bool new_light = false;      ///< light() is another from this frame on.
  std::optional<Outcome> rezeroed;  ///< Result of the requested re-zero.
};

/// How far the reference can be trusted.
struct Trust {
  bool stale = false;     ///< It was scaled from another light.
  double light_left = 0;  ///< Light change that is not followed: a share, positive = brighter.
  /// Expected change of the light while out of sight: a share, 0 or more.
  double light_unseen = 0;
};

/// The reference image in the present light, reference × light + drift, with its state:
/// where a frame differs from it, how the light changes, which health flags hold, how far to trust
/// it. The only owner of this knowledge. Capture thread unless noted otherwise; there it
/// does not allocate.
class ReferenceTracker {
 public:
  /// Frames of width × height pixels, lit by what `light` says, which outlives the tracker. Throws
  /// std::invalid_argument when the frames are too small or the rules impossible.
  /// `decode_scale`: see CameraShiftDetector.
  ReferenceTracker(int width, int height, const LightTimeline& light, const PipelineConfig& config,
                   int decode_scale = 1);

  // Not on the capture thread.

  /// Starts its thread, which writes references to the state folder and detects camera shift.
  void start() { side_.start(); }
  /// Writes a reference that still waits for it, and stops the thread after the work it has been
  /// given. Once the capture thread has ended.
  void stop() noexcept;
  /// Waits until all pending camera shift checks are done. Any thread.
  void settle() const noexcept { camera_shift_.settle(); }
  /// How far the camera has moved since calibration; empty: not. Any thread.
  [[nodiscard]] std::string camera_shift_message() const { return camera_shift_.message(); }
  /// Why the last reference could not be written and what to do; empty when it was. Any thread.
  [[nodiscard]] std::string storage_message() const { return writer_.message(); }
  /// A reference was written, so that of an earlier run is gone. Any thread.
  [[nodiscard]] bool has_written() const noexcept { return writer_.has_written(); }
  /// The last good reference of an earlier run by this calibration, if the state folder has one.
  /// Before the first look. Throws std::runtime_error naming the file that cannot be read.
  void restore(const calibration::Calibration& calibration);

  // Changes of the image and requests for it.

  /// The last good reference of an earlier run, taken under `light`.
  void restore(std::span<const std::uint16_t> reference_q8, const hal::Light& light);
  /// From now on this calibration; null: none. A fresh reference stays.
  void use(CalibratedImage* image) noexcept;
  /// The camera has restarted or its controls were set back: what was known of its image is in
  /// doubt.
  void camera_began() noexcept;
  /// The timeline's light has changed from `before`.
  void light_changed(const hal::Light& before) noexcept;
  /// Exposure or gain has changed, to the picture another light of the same shape.
  void exposure_changed() noexcept;
  /// Requests the present image as reference. A returned outcome is an immediate refusal; otherwise
  /// look() returns it. Only while there is a calibration.
  [[nodiscard]] std::optional<Outcome> rezero(bool force) noexcept {
    return keeper_.rezero(force, in_contact_);
  }
  void cancel_rezero() noexcept { keeper_.cancel_rezero(); }
  /// Whether depth found contact in the frame just looked at. Where no depth is made, activity
  /// counts.
  void set_in_contact(bool in_contact) noexcept { in_contact_ = in_contact; }

  // Each frame.

  /// The next image counts for a reference, all of it; else what the map reads is enough.
  [[nodiscard]] bool needs_whole_frame() const noexcept { return keeper_.looks(); }
  /// Looks at a frame. Mostly cheap; a decision on the reference takes about two frames' time.
  Observation look(const hal::LumaView& luma, const FrameState& moment) noexcept;

  // Results.

  [[nodiscard]] State state() const noexcept;
  /// The health flags after the last look.
  [[nodiscard]] HealthSet health_flags() const noexcept;
  [[nodiscard]] Trust trust() const noexcept;
  /// A plane of cells (CalibratedImage::cells): not 0 where the frame differs from it.
  [[nodiscard]] std::span<const std::int32_t> active() const noexcept {
    return image_->cells.active();
  }
  [[nodiscard]] bool any_active() const noexcept { return report_.active_cells > 0; }
  /// There is a reference to measure against.
  [[nodiscard]] bool ready() const noexcept { return keeper_.ready(); }
  [[nodiscard]] ReferenceQuality quality() const noexcept { return keeper_.quality(); }
  /// The reference as it was taken: Q8 luma, frame sized. Only when ready().
  [[nodiscard]] std::span<const std::uint16_t> reference() const noexcept {
    return keeper_.reference();
  }
  /// The light it was taken under, or scaled to: what the ring shows.
  [[nodiscard]] const hal::Light& ring_light() const noexcept { return timeline_.light(); }
  /// The present light as a factor on it.
  [[nodiscard]] double light() const noexcept { return follower_.factor(); }

 private:
  void use_reference() noexcept;
  void keep_reference(std::int64_t now_ns) noexcept;

  int width_;
  int height_;
  const LightTimeline& timeline_;
  const std::filesystem::path folder_;
  base::BackgroundThread side_{"dtact-side"};  // before its jobs
  ReferenceWriter writer_;
  CameraShiftDetector camera_shift_;
  CalibratedImage* image_ = nullptr;
  ReferenceKeeper keeper_;
  LightFollower follower_;
  ImageWatch watch_;
  ExposureWatch exposure_;
  CellReport report_;
  bool settled_ = true;       // the frame looked at
  bool in_contact_ = false;   // in the frame before
  bool other_light_ = false;  // the ring shows another than at calibration
  bool other_level_ = false;  // the reference's light is not the calibration's, and it matters
  bool keep_due_ = false;     // the reference in use waits to be written
  std::optional<std::int64_t> kept_ns_;  // when one was written last, CLOCK_MONOTONIC
  std::int64_t keep_every_ns_ = 0;       // how long after it the next may be
};

}  // namespace dtact::pipeline
