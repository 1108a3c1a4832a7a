#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hal/base/unique_fd.hpp"
#include "hal/config.hpp"
#include "hal/frame.hpp"

namespace dtact::hal::v4l2 {

/// A buffer that the driver has filled.
struct Filled {
  int index = -1;
  std::span<const std::uint8_t> payload;
  std::uint32_t sequence = 0;     ///< The driver's count since the stream began.
  std::int64_t timestamp_ns = 0;  ///< CLOCK_MONOTONIC.
  TimestampMeaning meaning = TimestampMeaning::arrival;
  bool flagged = false;  ///< V4L2_BUF_FLAG_ERROR.
};

enum class DequeueStatus : std::uint8_t { filled, none, failed };

/// What the driver agreed to.
struct Format {
  std::uint32_t fourcc = 0;
  int width = 0;
  int height = 0;
  std::ptrdiff_t bytes_per_line = 0;  ///< 0 for compressed formats.
  bool full_range = true;             ///< Of raw luma.
};

/// A capture stream with memory-mapped buffers. The destructor stops it and unmaps.
class Stream {
 public:
  static constexpr unsigned kBuffers = 4;

  /// Sets the mode `asked` in `fourcc` and maps the buffers. Throws ModeError when the driver
  /// agrees to something else, DeviceError when it refuses.
  Stream(base::UniqueFd fd, const std::string& node, std::uint32_t fourcc,
         const CameraConfig& asked);
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  ~Stream();

  /// Hands all buffers to the driver and starts it. Throws DeviceError.
  void start();
  /// Gives the buffers up, so that the device can be opened anew while others hold this object.
  void stop() noexcept;

  [[nodiscard]] int fd() const noexcept { return fd_.get(); }
  [[nodiscard]] const Format& format() const noexcept { return format_; }

  /// Waits at most until `deadline_ns` (CLOCK_MONOTONIC) for a buffer or an error.
  void wait(std::int64_t deadline_ns) const noexcept;
  /// The oldest filled buffer, if any. `failed`: the stream is of no more use.
  [[nodiscard]] DequeueStatus dequeue(Filled& out) noexcept;
  /// Hands a buffer back to the driver. False: the stream is of no more use.
  [[nodiscard]] bool enqueue(int index) noexcept;

 private:
  void set_format(std::uint32_t fourcc, const CameraConfig& asked);
  void set_rate(double fps);
  void map_buffers();

  base::UniqueFd fd_;
  std::string node_;
  Format format_;
  std::vector<std::span<std::uint8_t>> buffers_;
};

}  // namespace dtact::hal::v4l2
