#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/camera.hpp"
#include "hal/config.hpp"
#include "hal/light_ring.hpp"

namespace dtact::hal::null {

/// The camera that does nothing: mid-grey frames at the configured rate, forever.
class NullCamera final : public Camera, private FrameOwner {
 public:
  static constexpr std::uint8_t kGrey = 128;

  explicit NullCamera(const CameraConfig& config, base::Clock& clock = base::system_clock());

  [[nodiscard]] CameraInfo info() const override;
  [[nodiscard]] CameraReport report() const override;
  void start() override;
  [[nodiscard]] GrabStatus grab(Frame& out, std::chrono::nanoseconds timeout) noexcept override;

 private:
  void give_back(int index) noexcept override;

  CameraConfig config_;
  base::Clock& clock_;
  std::vector<std::uint8_t> pixels_;  // every frame is this one
  std::int64_t period_ns_;
  std::int64_t next_ns_ = 0;
  std::atomic<std::uint64_t> delivered_{0};  // any thread reads it
};

/// The ring that does nothing, for sensors whose light no computer commands.
class NullRing final : public LightRing {
 public:
  [[nodiscard]] RingInfo info() const override { return {"null", "null"}; }
  [[nodiscard]] ShowResult show(const Light& /*light*/) override { return {}; }
};

}  // namespace dtact::hal::null
