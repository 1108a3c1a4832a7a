#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/frame.hpp"

namespace dtact::hal {

/// What is known of a control after it was set.
enum class ControlVerdict : std::uint8_t {
  refused,   ///< It isn't as asked for, and may act by itself.
  accepted,  ///< Taken without an error; no answer of the camera's own says that it holds.
  confirmed  ///< The camera itself, asked after the setting, says the value.
};

/// One photometric control as the camera reports it after it was set.
struct CameraControl {
  std::string name;        ///< "exposure_absolute", ...
  std::int64_t value = 0;  ///< In the camera's own unit, as read back.
  ControlVerdict verdict = ControlVerdict::refused;
  /// When refused: by whom, and what may follow. Else what to know, or empty.
  std::string note = {};
};

/// A number that can be changed while the camera streams, and its range.
struct CameraSetting {
  double value = 0;
  double minimum = 0;
  double maximum = 0;
};

/// What the camera has of them.
struct CameraSettings {
  std::optional<CameraSetting> exposure_us;  ///< Microseconds.
  std::optional<CameraSetting> gain;         ///< In the camera's own unit.
};

/// New values; what is not given stays.
struct CameraChange {
  std::optional<double> exposure_us;  ///< Microseconds.
  std::optional<double> gain;         ///< In the camera's own unit.
  [[nodiscard]] bool operator==(const CameraChange&) const = default;
};

/// Who the camera is and how it runs. Size and rate are fixed from construction on; the other
/// fields are those of the device last attached.
struct CameraInfo {
  std::string backend;       ///< "null", "sim", "replay", ...
  std::string identity;      ///< Stable name: by-path, serial, scene file, folder.
  std::string pixel_format;  ///< "GREY", "YUYV", "MJPEG", ... as it comes from the device.
  int width = 0;             ///< Pixels of the frames that grab() gives.
  int height = 0;            ///< Pixels of the frames that grab() gives.
  /// The device's own frames, JPEGs, are this many times as wide and as high.
  int decode_scale = 1;
  double fps = 0;  ///< The mode's nominal frames per second.
  /// A light change is complete in frames whose exposure began at least this number of periods
  /// after it, according to their timestamps (exposure plus the camera's queue).
  int light_delay_frames = 2;
  std::vector<CameraControl> controls;
  CameraSettings settings;
};

/// A camera that has sent nothing for longer than this has stalled. Nanoseconds.
[[nodiscard]] constexpr std::int64_t stall_ns(std::int64_t frame_period_ns) noexcept {
  return 3 * frame_period_ns;
}

enum class CameraState : std::uint8_t { streaming, stalled, unplugged, busy, denied, ended };

/// Why payloads were damaged.
struct DamageCounts {
  std::uint64_t flagged = 0;      ///< The driver marked the buffer (V4L2_BUF_FLAG_ERROR).
  std::uint64_t markers = 0;      ///< A JPEG without its first or last marker.
  std::uint64_t too_short = 0;    ///< Fewer bytes than the image has.
  std::uint64_t undecodable = 0;  ///< Whole, but broken inside or another size.
};

/// Run-time state of a camera. Any thread may ask.
struct CameraReport {
  CameraState state = CameraState::streaming;
  std::string fix;              ///< A sentence saying what to do; empty while streaming.
  std::uint64_t delivered = 0;  ///< Frames handed out.
  /// Every gap in the sequence is counted in exactly one of the two. `lost`: the camera or its
  /// driver lost the frame. `skipped`: this process came late. It passed the frame over for a newer
  /// one, or had not returned a buffer that the driver could have filled.
  std::uint64_t lost = 0;
  std::uint64_t skipped = 0;
  std::uint64_t damaged = 0;  ///< Truncated or undecodable payloads.
  DamageCounts damage;        ///< The same by cause.
  /// Why the newest damaged payload could not be decoded, without a full stop; empty when it was
  /// damaged otherwise, or there was none.
  std::string damage_reason;
  std::uint64_t disconnects = 0;  ///< Times the device went away.
  /// Controls that moved by themselves within the last seconds, and were set again; empty when
  /// none.
  std::string moved;
};

enum class GrabStatus : std::uint8_t {
  ok,
  timeout,    ///< Nothing came in time; ask again.
  damaged,    ///< A frame came, was unusable and has been counted; ask again.
  unplugged,  ///< The device is away. Later calls try to get it back and return ok once it is.
  ended       ///< No frame will ever come again (a recording played once).
};

/// A source of grey frames. One thread calls start() and grab().
class Camera {
 public:
  Camera() = default;
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;
  virtual ~Camera() = default;

  [[nodiscard]] virtual CameraInfo info() const = 0;
  [[nodiscard]] virtual CameraReport report() const = 0;
  /// Begins streaming. Throws std::runtime_error with a sentence that names the fix.
  virtual void start() = 0;
  /// What of the images will be read from now on: a compressed frame need not be decoded beyond it,
  /// and what lies there is unspecified (a camera may deliver it all the same). It lies in the
  /// image; until the first call it is the whole. Called between two grabs, by their thread.
  virtual void will_read(const Area& /*area*/) noexcept {}
  /// Changes settings that info() has, within their ranges, until the object ends; also of a camera
  /// that is plugged in again. May take a second. Any thread but the one that calls grab(). Throws
  /// std::runtime_error when the camera refuses.
  virtual void change(const CameraChange& /*change*/) {}
  /// Waits at most `timeout` for the newest complete frame. Does not allocate in steady state. The
  /// caller holds at most one frame: assigning `out` gives the one before back.
  [[nodiscard]] virtual GrabStatus grab(Frame& out, std::chrono::nanoseconds timeout) noexcept = 0;
};

}  // namespace dtact::hal
