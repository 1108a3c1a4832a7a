#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/camera.hpp"
#include "hal/frame.hpp"

namespace dtact::hal::live {

/// Why a camera cannot be used now, with the fix. The cause may pass by itself.
class DeviceError : public std::runtime_error {
 public:
  DeviceError(CameraState state, const std::string& sentence)
      : std::runtime_error(sentence), state_(state) {}
  [[nodiscard]] CameraState state() const noexcept { return state_; }

 private:
  CameraState state_;
};

/// The camera is there and doesn't offer what is asked for: only another configuration, or another
/// camera, helps.
class ModeError : public DeviceError {
 public:
  explicit ModeError(const std::string& sentence) : DeviceError(CameraState::unplugged, sentence) {}
};

/// How a payload is encoded.
enum class Encoding : std::uint8_t { grey, grey10, grey16, nv12, yuyv, jpeg };

struct Format {
  Encoding encoding = Encoding::grey;
  int width = 0;
  int height = 0;
  std::ptrdiff_t bytes_per_line = 0;  ///< 0 = lines without padding; of no meaning for JPEG.
  bool full_range = true;             ///< range of raw luma
  /// Full-range grey payloads may be used in place: kLumaPadding bytes after them can be read,
  /// and they stay readable until the source is destroyed.
  bool zero_copy = false;
};

/// A buffer that the driver has filled.
struct FilledBuffer {
  int index = -1;
  std::span<const std::uint8_t> payload;
  std::uint32_t sequence = 0;     ///< The driver's count since the stream began.
  std::int64_t timestamp_ns = 0;  ///< CLOCK_MONOTONIC.
  TimestampMeaning meaning = TimestampMeaning::arrival;
  bool flagged = false;  ///< The driver says that the payload is damaged.
};

enum class DequeueStatus : std::uint8_t { filled, none, failed };

/// A device that streams. wait(), dequeue(), enqueue() and stop() belong to the capture thread.
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;

  [[nodiscard]] virtual Format format() const noexcept = 0;
  /// Waits at most until `deadline_ns` (CLOCK_MONOTONIC) for a buffer or an error.
  virtual void wait(std::int64_t deadline_ns) noexcept = 0;
  /// The oldest filled buffer, if any. `failed`: the stream is of no more use.
  [[nodiscard]] virtual DequeueStatus dequeue(FilledBuffer& out) noexcept = 0;
  /// Number of buffers that the driver holds, filled or empty.
  [[nodiscard]] virtual int queued() const noexcept = 0;
  /// Hands a buffer back to the driver. False: the stream is of no more use.
  [[nodiscard]] virtual bool enqueue(int index) noexcept = 0;
  /// Closes the device, so that it can be reopened while this object still exists.
  virtual void stop() noexcept = 0;
  /// Reads the locked ones of `controls` again and sets back what has moved. Returns the sentence
  /// that says what moved; empty when nothing did. Called on another thread than the rest.
  [[nodiscard]] virtual std::string check_controls(std::vector<CameraControl>& controls) = 0;
  /// Changes settings that Opened has, within their ranges, and what `controls` and `settings` say
  /// of them. On any thread but the capture thread, never beside check_controls(). Throws
  /// std::runtime_error when the camera refuses.
  virtual void change(const CameraChange& /*change*/, std::vector<CameraControl>& /*controls*/,
                      CameraSettings& /*settings*/) {}
  /// The same after the opening, while nobody takes frames yet: a source that changes its settings
  /// with its buffers takes some itself. Called on the thread that opened it.
  virtual void change_before_use(const CameraChange& change, std::vector<CameraControl>& controls,
                                 CameraSettings& settings) {
    this->change(change, controls, settings);
  }
};

/// A device that has been opened and streams.
struct Opened {
  std::shared_ptr<Source> source;
  std::string identity;      ///< as in CameraInfo
  std::string pixel_format;  ///< as in CameraInfo
  std::vector<CameraControl> controls;
  CameraSettings settings = {};
};

/// Opens the configured device and starts it. Throws DeviceError.
using Opener = std::function<Opened()>;

}  // namespace dtact::hal::live
