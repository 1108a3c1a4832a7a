#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/base/rt_thread.hpp"
#include "hal/base/unique_fd.hpp"
#include "hal/camera.hpp"
#include "hal/luma/luma.hpp"
#include "hal/sim/payload.hpp"
#include "hal/sim/renderer.hpp"
#include "hal/sim/sim_ring.hpp"

namespace dtact::hal::sim {

/// The device's output: one frame as it comes off the bus.
struct Payload {
  std::vector<std::uint8_t> buffer;
  std::size_t bytes = 0;
  std::uint64_t sequence = 0;
  std::int64_t ready_ns = 0;      ///< CLOCK_MONOTONIC.
  std::uint64_t lost_before = 0;  ///< Frames that never left the device, since start.
};

/// The far side of the cable: renders, packs, paces, and misbehaves as the scene says.
class Device {
 public:
  Device(const Scene& scene, std::uint64_t seed, Output output, std::shared_ptr<LightLink> link,
         base::Clock& clock);
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  ~Device();

  /// Starts the thread that makes a frame a period.
  void run_paced();
  /// Readable when a payload waits or the device went away; read it to clear it.
  [[nodiscard]] int event_fd() const noexcept { return event_.get(); }
  /// The newest payload not taken yet, or null. Valid until the next call. One thread.
  [[nodiscard]] const Payload* take() noexcept;

  /// Without the thread: makes the next frame of the sequence. Null when the scene swallows it;
  /// state() says how.
  [[nodiscard]] const Payload* make_next() noexcept;

  [[nodiscard]] CameraState state() const noexcept { return state_; }
  /// The scene has a driver's call hang now.
  [[nodiscard]] bool hangs() const noexcept { return hangs_; }
  [[nodiscard]] std::uint64_t disconnects() const noexcept { return disconnects_; }
  /// Multiplies the scene's exposure, from the frame after the next one on. Any thread.
  void set_brightness(double factor) noexcept { brightness_ = factor; }
  [[nodiscard]] const Scene& scene() const noexcept { return renderer_.truth().scene(); }

 private:
  static constexpr unsigned kFresh = 4;  // beside the index in newest_

  void loop();
  bool make(std::uint64_t sequence, Payload& payload) noexcept;
  [[nodiscard]] LedLevels exposed_light() noexcept;
  /// Takes half of the light from the left third of the image's first rows.
  void cover(int rows) noexcept;
  /// Exposes the next frame so that the mean goes back to that of the first frame so regulated.
  void regulate(bool automatic) noexcept;
  void wake() noexcept;

  Renderer renderer_;
  PayloadEncoder encoder_;
  std::shared_ptr<LightLink> link_;
  base::Clock& clock_;
  luma::LumaBuffer image_;
  double gain_ = 1;  // of an exposure that runs automatically
  std::atomic<double> brightness_{1};
  double kept_grey_ = 0;         // the mean that it keeps; 0: it does not
  std::vector<LedLevels> seen_;  // [0] what the ring shows now, [1] a frame ago, ...

  std::array<Payload, 3> payloads_;
  std::atomic<unsigned> newest_{1};
  unsigned writing_ = 0;
  unsigned reading_ = 2;
  std::uint64_t sequence_ = 0;
  std::uint64_t lost_ = 0;

  base::UniqueFd event_;
  std::atomic<CameraState> state_{CameraState::streaming};
  std::atomic<std::uint64_t> disconnects_{0};
  std::atomic<bool> hangs_{false};
  bool paced_ = false;
  std::atomic<bool> stop_{false};
  base::RtThread thread_;  // last: it uses all of the above
};

}  // namespace dtact::hal::sim
