#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/pipeline/capture_loop.hpp"
#include "daemon/pipeline/exchange.hpp"
#include "daemon/pipeline/light_driver.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/port.hpp"
#include "hal/base/rt_thread.hpp"

namespace dtact::pipeline {

/// Throws std::invalid_argument naming the setting and its fix when frames of this size or rate
/// cannot be used.
void check_camera(const hal::CameraInfo& info);

/// The sensor at work: owns camera and ring and the three threads about them (capture, light,
/// storage). Between start() and stop() the network thread uses it through Port.
class Pipeline final : public Port {
 public:
  /// `calibration` may be null: luma only. Allocates all memory that run time needs. Throws
  /// std::invalid_argument naming the setting and its fix. A calibration for another frame size
  /// sets a health flag and is no error.
  Pipeline(std::unique_ptr<hal::Camera> camera, std::unique_ptr<hal::LightRing> ring,
           const std::shared_ptr<const calibration::Calibration>& calibration,
           PipelineConfig config, base::Clock& clock = base::system_clock());
  ~Pipeline() override { stop(); }

  /// Turns on ring and camera and starts the threads. Call once. Throws std::runtime_error with
  /// the fix when the camera does not start; a ring that fails sets a health flag.
  void start();
  /// Turns the ring dark, then ends and joins the threads: within a tenth of a second and what the
  /// camera's and the ring's calls in progress take. The last good reference is written out before
  /// it returns.
  void stop() noexcept;

  /// Turns of the capture loop so far: ten a second at least, whatever the camera's state, unless a
  /// call of the camera does not come back. Any thread.
  [[nodiscard]] std::uint64_t heartbeat() const noexcept {
    return exchange_.turns.load(std::memory_order_relaxed);
  }

  [[nodiscard]] int event_fd() const noexcept override { return exchange_.wake.get(); }
  [[nodiscard]] const DepthFrame* latest() noexcept override { return exchange_.slot.fetch(); }
  [[nodiscard]] std::optional<Event> next_event() override;
  [[nodiscard]] bool submit(Command command) override;
  void want(Wanted wanted) noexcept override;
  [[nodiscard]] Status status() const override;
  [[nodiscard]] UseCalibration prepare(
      const std::shared_ptr<const calibration::Calibration>& calibration,
      const ReconstructionRules& rules) const override;
  [[nodiscard]] SetReconstruction prepare_maps(
      const std::shared_ptr<const calibration::Calibration>& in_use,
      const ReconstructionRules& rules) const override;

 private:
  [[nodiscard]] DepthFrame prototype(const calibration::Calibration* calibration) const;
  void finish(CommandDone& done);
  void compare_camera();

  PipelineConfig config_;
  base::Clock& clock_;
  std::unique_ptr<hal::Camera> camera_;
  hal::CameraInfo info_;
  Exchange exchange_;
  LightDriver light_;
  std::unique_ptr<CaptureLoop> loop_;
  std::size_t depth_capacity_;  // pixels that every frame of the pool has room for
  std::string restore_failure_;
  std::vector<std::string> realtime_;  // settings refused, one sentence each
  std::optional<int> cpu_;             // that the capture thread is pinned to
  // Network thread only.
  ReconstructionRules rules_;
  std::shared_ptr<const calibration::Calibration> calibration_;  // in use; null: none
  base::RtThread capture_;                                       // last: it uses all the others
};

}  // namespace dtact::pipeline
