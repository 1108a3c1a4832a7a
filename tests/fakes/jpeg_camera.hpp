#pragma once

#include <cstdint>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/camera.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"

namespace dtact::fakes {

/// A camera that decodes one of its JPEG payloads, in turn, for every frame.
class JpegCamera final : public hal::Camera, private hal::FrameOwner {
 public:
  /// Calls `on_grab` on the capture thread before each frame, with the number delivered so far.
  JpegCamera(int width, int height, std::vector<std::vector<std::uint8_t>> payloads,
             std::function<void(std::uint64_t)> on_grab)
      : payloads_(std::move(payloads)),
        on_grab_(std::move(on_grab)),
        decoder_(width, height),
        buffer_(width, height) {}

  [[nodiscard]] hal::CameraInfo info() const override {
    return {.backend = "fake",
            .identity = "fake JPEG camera",
            .pixel_format = "MJPEG",
            .width = buffer_.width(),
            .height = buffer_.height(),
            .fps = 100,  // promised: less than it has, so that it is never slow
            .light_delay_frames = 2,
            .controls = {},
            .settings = {}};
  }
  [[nodiscard]] hal::CameraReport report() const override { return {}; }
  void start() override {}
  void will_read(const hal::Area& area) noexcept override { decoder_.set_crop(area); }
  [[nodiscard]] hal::GrabStatus grab(hal::Frame& out,
                                     std::chrono::nanoseconds /*timeout*/) noexcept override {
    on_grab_(sequence_);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    hal::FrameInfo frame;
    frame.sequence = sequence_;
    frame.timestamp_ns = base::system_clock().monotonic_ns();
    frame.ready_ns = frame.timestamp_ns;
    const auto& payload = payloads_[sequence_++ % payloads_.size()];
    if (decoder_.decode(payload, buffer_.data(), buffer_.stride()) != hal::mjpeg::Status::ok) {
      return hal::GrabStatus::damaged;
    }
    frame.decode_ns = base::system_clock().monotonic_ns() - frame.ready_ns;
    out = hal::Frame(*this, 0, buffer_.view(), frame, payload);
    return hal::GrabStatus::ok;
  }

 private:
  void give_back(int /*index*/) noexcept override {}

  std::vector<std::vector<std::uint8_t>> payloads_;
  std::function<void(std::uint64_t)> on_grab_;
  hal::mjpeg::GreyDecoder decoder_;
  hal::luma::LumaBuffer buffer_;
  std::uint64_t sequence_ = 0;
};

}  // namespace dtact::fakes
