#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "daemon/pipeline/camera_watch.hpp"
#include "daemon/pipeline/contact.hpp"
#include "daemon/pipeline/exchange.hpp"
#include "daemon/pipeline/image_watch.hpp"
#include "daemon/pipeline/light_driver.hpp"
#include "daemon/pipeline/light_follower.hpp"
#include "daemon/pipeline/light_timeline.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/place_watch.hpp"
#include "daemon/pipeline/reference_keeper.hpp"
#include "daemon/pipeline/reference_writer.hpp"
#include "daemon/pipeline/teller.hpp"
#include "daemon/pipeline/uncertainty.hpp"
#include "hal/base/clock.hpp"
#include "hal/camera.hpp"

namespace dtact::pipeline {

/// What the capture thread works with; all of it outlives the loop.
struct CaptureParts {
  hal::Camera& camera;
  LightDriver& light;
  ReferenceWriter& writer;
  PlaceWatch& place;
  Exchange& exchange;
  base::Clock& clock;
};

/// The capture thread: frame in, depth out, and every decision about light and reference on the
/// way. With a calibration each frame is reconstructed, whoever listens, since contact events and
/// the refusal to re-zero need it; frames are published, and maps kept in them, only when wanted.
/// Never waits for another thread; in steady state it does not allocate, log or touch a socket.
class CaptureLoop {
 public:
  /// `active` may be null: uncalibrated. `unusable`: there is a calibration, but for another camera
  /// mode.
  CaptureLoop(const CaptureParts& parts, const PipelineConfig& config,
              std::unique_ptr<ActiveCalibration> active, bool unusable);

  /// Before run(): the last good reference of an earlier run.
  void restore(std::span<const std::uint16_t> reference_q8, const hal::Light& light);
  /// Until Exchange::stop; notices it within a tenth of a second unless the camera blocks longer
  /// than it was asked to.
  void run() noexcept;

 private:
  void choose_area() noexcept;
  void process(std::int64_t now_ns) noexcept;
  void without_frame(hal::GrabStatus status, std::int64_t asked_ns, std::int64_t now_ns) noexcept;
  void reconstruct(DepthFrame& out) noexcept;
  void judge(DepthFrame& out) noexcept;
  void mind_reference(bool settled) noexcept;
  /// From now on depth is measured against the keeper's reference.
  void use_reference() noexcept;
  void publish(DepthFrame& out) noexcept;
  void tell(HealthSet health, std::int64_t now_ns) noexcept;
  [[nodiscard]] State state() const noexcept;
  [[nodiscard]] HealthSet health(bool settled, std::int64_t now_ns) const noexcept;

  // capture_orders.cpp
  void take_notes() noexcept;
  void take_orders() noexcept;
  void execute(const RezeroOrder& order) noexcept;
  void execute(CalibrationOrder& order) noexcept;
  /// Answers the re-zero under way, if there is one.
  void answer(RezeroResult result) noexcept;
  void answer(Outcome outcome, const char* sentence) noexcept;
  /// The camera is away.
  void give_up_rezero() noexcept;

  hal::Camera& camera_;
  LightDriver& light_;
  ReferenceWriter& writer_;
  PlaceWatch& place_;
  Exchange& exchange_;
  base::Clock& clock_;
  const PipelineConfig& config_;
  const std::int64_t period_ns_;

  std::unique_ptr<ActiveCalibration> active_;
  bool unusable_;
  ReferenceKeeper keeper_;
  ContactDetector contact_;
  ResolutionChooser chooser_;
  CameraWatch watch_;
  ImageWatch image_watch_;
  LightFollower follower_;
  LightTimeline timeline_;
  Teller teller_;
  hal::Frame frame_;
  const hal::Area whole_;  // frame
  hal::Area area_;         // of the frame that is asked for

  hal::Light shown_;  // by the ring, as last noted
  bool light_mismatch_ = false;
  bool other_level_ = false;     // the reference's light is not the calibration's, and it matters
  bool beyond_ = false;          // in the newest frame
  bool controls_moved_ = false;  // as the newest frame says
  std::int64_t beyond_until_ns_ = INT64_MIN;
  std::optional<double> follow_due_;     // the light's factor waits to be applied
  bool keep_due_ = false;                // the reference in use waits to be written
  std::optional<std::uint64_t> rezero_;  // ticket of the one under way
};

}  // namespace dtact::pipeline
