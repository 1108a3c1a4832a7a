#pragma once

#include <linux/videodev2.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hal/base/unique_fd.hpp"
#include "hal/config.hpp"
#include "hal/live/source.hpp"
#include "hal/v4l2/photometry.hpp"

namespace dtact::hal::v4l2 {

/// A capture stream with memory-mapped buffers. The destructor stops it and unmaps.
class Stream final : public live::Source {
 public:
  static constexpr unsigned kBuffers = 4;

  /// Sets the mode `asked` in `fourcc` and maps the buffers. Throws ModeError when the driver
  /// agrees to something else, DeviceError when it refuses.
  Stream(base::UniqueFd fd, const std::string& node, std::uint32_t fourcc,
         const CameraConfig& asked, const PhotometricLock& lock);
  ~Stream() override;

  /// Sets every control of the lock and reads it back: before start(), so that the first frame is
  /// right.
  void lock_controls();
  /// The same after start(), since some cameras forget when they start. Returns what is known then.
  [[nodiscard]] std::vector<CameraControl> lock_controls_again();
  /// Hands all buffers to the driver and starts it. Throws DeviceError.
  void start();

  [[nodiscard]] live::Format format() const noexcept override { return format_; }
  void wait(std::int64_t deadline_ns) noexcept override;
  [[nodiscard]] live::DequeueStatus dequeue(live::FilledBuffer& out) noexcept override;
  [[nodiscard]] int queued() const noexcept override { return queued_; }
  [[nodiscard]] bool enqueue(int index) noexcept override;
  void stop() noexcept override;
  [[nodiscard]] std::string check_controls(std::vector<CameraControl>& controls) override;
  void change(const CameraChange& change, std::vector<CameraControl>& controls,
              CameraSettings& settings) override;
  [[nodiscard]] CameraSettings settings(const std::vector<CameraControl>& controls) const {
    return PhotometricLock::settings(fd_.get(), controls);
  }

 private:
  void set_format(std::uint32_t fourcc, const CameraConfig& asked);
  void set_rate(std::uint32_t fourcc, const CameraConfig& asked);
  void map_buffers();
  /// What a buffer's time is, as its flags say and as this driver keeps to it.
  [[nodiscard]] TimestampMeaning meaning_of(std::uint32_t flags) const noexcept;
  void set_time(const v4l2_buffer& buffer, live::FilledBuffer& out) const noexcept;

  base::UniqueFd fd_;
  std::string node_;
  PhotometricLock lock_;
  std::vector<LockedControl> controls_;  // before the stream began
  live::Format format_;
  bool uvcvideo_ = false;  // the driver
  std::vector<std::span<std::uint8_t>> buffers_;
  int queued_ = 0;
};

}  // namespace dtact::hal::v4l2
