#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "hal/base/clock.hpp"
#include "hal/camera.hpp"
#include "hal/config.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "hal/replay/recording.hpp"

namespace dtact::hal::replay {

/// Recorded frames at their own rate (timestamps.csv) or the configured one, once or in a loop. The
/// recording's size is the camera's, whatever the configuration says. All of it is held in memory,
/// at most kMaxBytes: PNG as pixels, JPEG as payloads that grab() decodes into one of two buffers.
///
/// Paced: a caller that is late gets the newest frame that is due; those passed over are skipped
/// and leave a gap in the sequence. Unpaced: every frame in turn, at once.
class ReplayCamera final : public Camera, private FrameOwner {
 public:
  /// Throws std::runtime_error as load_recording() does, std::invalid_argument when the rate is not
  /// above 0 or the recording is not decoded at 1/decode_scale.
  explicit ReplayCamera(const CameraConfig& config, base::Clock& clock = base::system_clock());

  [[nodiscard]] CameraInfo info() const override;
  [[nodiscard]] CameraReport report() const override;
  void start() override;
  void will_read(const Area& area) noexcept override { decoder_.set_crop(area); }
  [[nodiscard]] GrabStatus grab(Frame& out, std::chrono::nanoseconds timeout) noexcept override;

 private:
  [[nodiscard]] std::int64_t due_ns(std::uint64_t sequence) const noexcept;
  /// The last frame that is due at a time after the start.
  [[nodiscard]] std::uint64_t newest_due(std::int64_t now_ns) const noexcept;
  [[nodiscard]] GrabStatus lend(Frame& out, FrameInfo info) noexcept;
  void give_back(int /*index*/) noexcept override {}
  [[nodiscard]] const char* pixel_format() const noexcept {
    return recording_.is_jpeg() ? "MJPEG" : "GREY";
  }

  CameraConfig config_;
  base::Clock& clock_;
  Recording recording_;
  int decode_scale_;
  double fps_ = 0;
  std::int64_t round_ns_ = 0;  ///< From the first frame to the first of the next round.
  mjpeg::GreyDecoder decoder_;
  // The caller holds one while the other is decoded into.
  std::array<luma::LumaBuffer, 2> decoded_;
  int next_buffer_ = 0;

  std::int64_t began_ns_ = 0;
  std::uint64_t next_ = 0;  ///< Sequence of the next frame.
  std::atomic<std::uint64_t> delivered_{0};
  std::atomic<std::uint64_t> skipped_{0};
  std::atomic<std::uint64_t> damaged_{0};
  std::atomic<std::size_t> damaged_frame_{0};             ///< The newest of them, in the recording.
  std::atomic<mjpeg::Status> damage_{mjpeg::Status::ok};  ///< Its decoder's answer.
  std::atomic<bool> ended_{false};
};

/// Reads the recording and decodes its first frame. Throws as the constructor does, or
/// std::runtime_error with the frame's name and the decoder's reason.
void check(const CameraConfig& config);

}  // namespace dtact::hal::replay
