#pragma once

#include <memory>

#include "hal/base/clock.hpp"
#include "hal/camera.hpp"
#include "hal/config.hpp"
#include "hal/sim/sim_ring.hpp"

namespace dtact::hal::sim {

/// Checks what the camera would refuse, without solving the scene. Throws std::runtime_error naming
/// file, line, key and fix.
void check(const CameraConfig& config);

/// The simulated sensor's camera. A thread of its own, "dtact-sim", is the device: it makes each
/// frame one period ahead and delivers it at its deadline. grab() unpacks the payload as it would
/// a real camera's. The device keeps three payloads: one it fills, the newest complete one, one
/// that grab() reads. A newer frame replaces an unfetched one. When the device falls behind,
/// its sequence jumps; those frames count as skipped, as this process came late.
///
/// With config.sim.paced == false there is no thread: every grab() makes the next frame of the
/// sequence, none is skipped, and scripted gaps pass without waiting.
class SimCamera final : public Camera, private FrameOwner {
 public:
  /// Loads and solves the scene (seconds for many presses). Throws as check().
  SimCamera(const CameraConfig& config, std::shared_ptr<LightLink> link,
            base::Clock& clock = base::system_clock());
  ~SimCamera() override;

  [[nodiscard]] CameraInfo info() const override;
  [[nodiscard]] CameraReport report() const override;
  void start() override;
  void change(const CameraChange& change) override;
  void will_read(const Area& area) noexcept override;
  [[nodiscard]] GrabStatus grab(Frame& out, std::chrono::nanoseconds timeout) noexcept override;

 private:
  class Impl;
  void give_back(int index) noexcept override;

  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::hal::sim
