#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

// What a client sees, free of protobuf. Coordinates, units and signs are those of dtact.proto:
// x right, y down, z towards the object, origin at the depth map's centre; indentation in
// millimetres, positive = pressed.
namespace dtact::client {

struct Rgb {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
  bool operator==(const Rgb&) const = default;
};

/// What the ring shows: each LED its colour, scaled by brightness / 255.
struct Light {
  std::uint8_t brightness = 0;
  std::vector<Rgb> leds;  ///< Eight; LED 0 at the image's right, then clockwise.
  bool operator==(const Light&) const = default;
};

struct Contact {
  bool touching = false;
  double area_mm2 = 0;
  double x_mm = 0;  ///< Depth-weighted centroid.
  double y_mm = 0;
  double deepest_mm = 0;
  double deepest_x_mm = 0;
  double deepest_y_mm = 0;
  double volume_mm3 = 0;
};

struct DepthMap {
  int width = 0;   ///< Pixels.
  int height = 0;  ///< Pixels.
  double mm_per_px = 0;
  double um_per_unit = 1;      ///< Micrometres a unit of `values`.
  std::int16_t untrusted = 0;  ///< The value of a pixel not to believe. 0 is a valid depth.
  int decimation = 1;          ///< 1, 2 or 4: 1/decimation of the calibration's resolution.
  /// Mean absolute error to expect inside the contact (dtact.proto), micrometres.
  double uncertainty_um = 0;
  std::vector<std::int16_t> values;  ///< Row-major.

  /// One pixel in millimetres, NaN where untrusted.
  [[nodiscard]] float millimetres(std::size_t index) const noexcept;
  /// All pixels in millimetres, row-major, NaN where untrusted.
  [[nodiscard]] std::vector<float> millimetres() const;
};

struct LumaMap {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> values;  ///< Row-major.
};

/// Nanoseconds in each stage, in their order. Where nothing touched, rectify, smooth and list are
/// 0.
struct StageTimes {
  std::uint32_t decode_ns = 0;
  std::uint32_t activity_ns = 0;  ///< The look for what changed.
  std::uint32_t rectify_ns = 0;
  std::uint32_t smooth_ns = 0;
  std::uint32_t list_ns = 0;
  std::uint32_t inspect_ns = 0;  ///< The contact summary.
  std::uint32_t publish_ns = 0;
  std::uint32_t encode_ns = 0;
};

struct Frame {
  std::uint64_t sequence = 0;       ///< The camera's; a gap is a lost frame.
  std::int64_t monotonic_ns = 0;    ///< Capture, CLOCK_MONOTONIC of the daemon's machine.
  std::int64_t wall_ns = 0;         ///< The same moment since 1970, UTC.
  std::string meaning;              ///< "start_of_exposure", "end_of_frame", "arrival".
  std::int64_t ready_ns = 0;        ///< CLOCK_MONOTONIC: complete at the HAL.
  std::int64_t published_ns = 0;    ///< CLOCK_MONOTONIC: depth done.
  std::vector<std::string> health;  ///< Conditions by name: "light_unsettled", … Empty: all well.
  Light light;                      ///< At the time of exposure.
  Contact contact;
  StageTimes times;
  std::optional<DepthMap> depth;
  std::optional<LumaMap> luma;
  std::uint64_t dropped = 0;  ///< Frames this client has missed since it connected.
  std::string frame_id;
};

struct ContactChanged {
  std::uint64_t sequence = 0;
  std::int64_t monotonic_ns = 0;
  Contact contact;  ///< touching: made; not: lost.
};
struct LightChanged {
  Light light;
};
struct ReferenceTaken {
  std::uint64_t sequence = 0;
  bool restored = false;  ///< The last good one from the state directory.
};
struct StateChanged {
  std::string state;  ///< "settling", "referencing", "serving", "uncalibrated", "camera_lost".
  std::vector<std::string> health;
};
struct CalibrationChanged {
  std::string name;
};
using Event =
    std::variant<ContactChanged, LightChanged, ReferenceTaken, StateChanged, CalibrationChanged>;

/// Who answered.
struct ServerInfo {
  std::string program;  ///< "dtactd 0.1.0"
  std::uint32_t major = 0;
  std::uint32_t minor = 0;
  std::string frame_id;
};

/// The number of the calibration that the daemon's configuration names. Uploaded ones count from 1.
inline constexpr std::uint64_t kConfiguredCalibration = 0;

struct CalibrationFiles {
  std::string name;
  std::string toml;  ///< calibration.toml
  std::string png;   ///< reference.png
  /// Under which the daemon keeps it. Empty in an upload and from a daemon that knows only one.
  std::optional<std::uint64_t> number = std::nullopt;
};

struct CalibrationSummary {
  std::string name;
  std::string method;  ///< "list", "published".
  double mm_per_px = 0;
  std::uint32_t width = 0;  ///< Of the depth map at full resolution, pixels.
  std::uint32_t height = 0;
  double covered_from_mm = 0;
  double covered_to_mm = 0;
  std::string created;            ///< ISO 8601.
  std::uint32_t frame_width = 0;  ///< Of the camera's image, pixels.
  std::uint32_t frame_height = 0;
};

/// One of the calibrations that the daemon has.
struct StoredCalibration {
  std::uint64_t number = kConfiguredCalibration;
  std::string name;
  std::string uploaded;                       ///< ISO 8601, UTC; empty for the configured one.
  bool current = false;                       ///< What the daemon starts with.
  bool in_use = false;                        ///< As far as an older daemon tells: the current one.
  std::optional<CalibrationSummary> summary;  ///< None when it cannot be read, …
  std::string damage;                         ///< … and why not.
};

struct Status {
  std::string state;
  std::vector<std::string> health;
  std::string advice;  ///< What to do; empty when all is well.
  struct Control {
    std::string name;
    std::int64_t value = 0;
    bool locked = false;
    std::string note;  ///< When not locked: what the camera refused. Else what to know, or empty.
  };
  struct Camera {
    std::string backend;
    std::string identity;
    std::string pixel_format;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    double fps = 0;
    std::string condition;
    std::string remedy;
    std::uint64_t delivered = 0;
    std::uint64_t lost = 0;
    std::uint64_t skipped = 0;
    std::uint64_t damaged = 0;
    /// `damaged` by cause.
    std::uint64_t damaged_flagged = 0;      ///< Marked by the driver.
    std::uint64_t damaged_markers = 0;      ///< A JPEG without its first or last marker.
    std::uint64_t damaged_short = 0;        ///< Fewer bytes than the image has.
    std::uint64_t damaged_undecodable = 0;  ///< Whole, but broken inside.
    std::uint64_t disconnects = 0;
    std::string moved;  ///< Controls that moved by themselves lately; empty when none.
    std::vector<Control> controls;
  } camera;
  struct Ring {
    std::string backend;
    std::string identity;
    std::string message;
  } ring;
  Light light;
  std::optional<CalibrationSummary> calibration;  ///< None when uncalibrated.
  std::uint64_t frames = 0;
  std::uint64_t skipped = 0;
  double fps = 0;
  std::vector<std::string> realtime_refused;
  struct Stage {
    std::string name;
    double p50_us = 0;
    double p99_us = 0;
    double max_us = 0;
  };
  std::vector<Stage> stages;
  struct Client {
    std::string address;
    std::string program;
    std::uint64_t sent = 0;
    std::uint64_t dropped = 0;
  };
  std::vector<Client> clients;
  std::string version;
  double uptime_s = 0;
  std::uint64_t encoded = 0;  ///< Frame messages, however many clients each went to.
  double light_followed = 0;  ///< By the reference since it was taken: a share, negative = dimmer.
  /// What the kernel counted of the capture thread since start.
  struct Usage {
    std::uint64_t minor_faults = 0;  ///< Pages mapped without reading from a disk.
    std::uint64_t major_faults = 0;  ///< Pages read from a disk.
    std::uint64_t waits = 0;         ///< Voluntary context switches.
    std::uint64_t preemptions = 0;   ///< Involuntary context switches.
  } capture_thread;
};

}  // namespace dtact::client
