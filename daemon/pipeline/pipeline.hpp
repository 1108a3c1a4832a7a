#pragma once

#include <cstdint>
#include <deque>
#include <map>
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

/// The sensor at work: owns camera and ring and the three threads about them (capture, light,
/// storage). Between start() and stop() the network thread uses it through Port.
class Pipeline final : public Port {
 public:
  /// `calibration` may be null: luma only. Takes all the memory that run time needs. Throws
  /// std::invalid_argument naming the setting and its remedy. A calibration for another frame size
  /// is a health condition, not an error.
  Pipeline(std::unique_ptr<hal::Camera> camera, std::unique_ptr<hal::LightRing> ring,
           const std::shared_ptr<const calibration::Calibration>& calibration,
           PipelineConfig config, base::Clock& clock = base::system_clock());
  ~Pipeline() override { stop(); }

  /// Ring on, camera on, threads running. Once only. Throws std::runtime_error with the remedy when
  /// the camera does not start; a ring that fails is a health condition.
  void start();
  /// Ends and joins the threads: within a tenth of a second and what the camera's and the ring's
  /// calls in progress take. The last good reference is written out before it returns.
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

 private:
  struct Known {
    std::uint64_t generation = 0;
    std::shared_ptr<const calibration::Calibration> calibration;
    std::uint64_t key = 0;  ///< UseCalibration::key.
  };
  [[nodiscard]] DepthFrame prototype(const calibration::Calibration* calibration) const;
  [[nodiscard]] bool use(std::uint64_t ticket, const UseCalibration& command);
  [[nodiscard]] bool reconstruct(std::uint64_t ticket, const ReconstructionRules& rules);
  /// Has the capture thread measure by this from now on. Throws std::invalid_argument.
  [[nodiscard]] bool order(std::uint64_t ticket, const Known& next,
                           const ReconstructionRules& rules, bool same_image);
  [[nodiscard]] bool refuse(std::uint64_t ticket, const char* sentence);
  [[nodiscard]] bool copy_reference(std::uint64_t ticket);
  void compare_camera();
  void free_retired();

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
  ReconstructionRules rules_;  ///< As asked for last.
  std::deque<Event> own_events_;
  std::deque<Known> calibrations_;  // in use, and on their way to be
  std::map<std::uint64_t, std::shared_ptr<ReferenceCopy>> copies_;  // being made, by ticket
  std::uint64_t generations_ = 0;
  base::RtThread capture_;  // last: it uses all the others
};

}  // namespace dtact::pipeline
