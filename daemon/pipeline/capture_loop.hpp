#pragma once

#include <chrono>
#include <cstdint>
#include <memory>

#include "daemon/pipeline/camera_watch.hpp"
#include "daemon/pipeline/command_executor.hpp"
#include "daemon/pipeline/depth/depth_maker.hpp"
#include "daemon/pipeline/event_reporter.hpp"
#include "daemon/pipeline/exchange.hpp"
#include "daemon/pipeline/light_driver.hpp"
#include "daemon/pipeline/light_timeline.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/reference/reference_tracker.hpp"
#include "hal/base/clock.hpp"
#include "hal/camera.hpp"

namespace dtact::pipeline {

/// What the capture thread works with; all of it outlives the loop.
struct CaptureParts {
  hal::Camera& camera;
  LightDriver& light;
  Exchange& exchange;
  base::Clock& clock;
};

/// The capture thread: grabs, updates the reference image, makes depth, publishes, reports events.
/// Makes depth while any client is subscribed; publishes it, with its maps, when requested. Never
/// waits for another thread; in steady state it does not allocate, log or use a socket.
class CaptureLoop {
 public:
  /// `active` may be null: uncalibrated. `unusable`: there is a calibration, but for another camera
  /// mode.
  CaptureLoop(const CaptureParts& parts, const PipelineConfig& config,
              std::shared_ptr<ActiveCalibration> active, bool unusable);

  /// For owners outside the loop: its threads and messages, and what is restored before the first
  /// step.
  [[nodiscard]] ReferenceTracker& tracker() noexcept { return tracker_; }
  /// Steps until Exchange::stop; notices it within 0.1 s unless the camera blocks longer than the
  /// requested time-out.
  void run() noexcept;
  /// One step: waits at most 0.1 s for a frame and processes it.
  void step() noexcept;

 private:
  void take_notes() noexcept;
  void choose_area() noexcept;
  void process(std::int64_t now_ns) noexcept;
  void label(DepthFrame& out, std::int64_t exposure_ns) noexcept;
  void look(DepthFrame& out, const FrameState& moment) noexcept;
  void publish(DepthFrame& out) noexcept;
  void without_frame(hal::GrabStatus status, std::int64_t asked_ns, std::int64_t now_ns) noexcept;
  void emit(HealthSet health, std::int64_t now_ns) noexcept;
  [[nodiscard]] Stamp stamp(std::int64_t at_ns) const noexcept;
  [[nodiscard]] std::int64_t rezero_limit_ns() const noexcept;
  [[nodiscard]] State state() const noexcept;
  [[nodiscard]] HealthSet health(std::int64_t now_ns) const noexcept;

  hal::Camera& camera_;
  LightDriver& light_;
  Exchange& exchange_;
  base::Clock& clock_;
  const std::int64_t period_ns_;
  const int decode_scale_;  // of the JPEGs to the frames
  const ReferenceRules reference_;
  const std::chrono::nanoseconds timeout_;

  LightTimeline timeline_;  // before the tracker, which reads it
  ReferenceTracker tracker_;
  DepthMaker depth_;
  CameraWatch watch_;
  EventReporter reporter_;
  CommandExecutor executor_;
  hal::Frame frame_;
  const hal::Area whole_;        // frame
  hal::Area area_;               // the requested part of the frame
  const bool unusable_;          // the first calibration is for another camera mode
  Wanted wanted_;                // when the newest frame came
  bool controls_moved_ = false;  // according to the newest frame
};

}  // namespace dtact::pipeline
