#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "hal/camera.hpp"
#include "hal/light_ring.hpp"

namespace dtact::pipeline {

struct ActiveCalibration;
class Resolutions;
struct CommandDone;

/// When something happened.
struct Stamp {
  std::uint64_t sequence = 0;     ///< The previous frame's; 0 also when there was none.
  std::int64_t monotonic_ns = 0;  ///< CLOCK_MONOTONIC.
  std::int64_t wall_ns = 0;       ///< The same moment since 1970.
};

/// The reference image in use.
struct ReferenceCopy {
  int width = 0;  ///< Pixels of the camera frame.
  int height = 0;
  std::vector<std::uint16_t> image_q8;  ///< Row-major, 256 units a grey level.
  hal::Light light;                     ///< The light when it was taken.
  std::uint64_t sequence = 0;           ///< The last frame in it.
  std::uint64_t calibration = 0;        ///< UseCalibration::key.
};

// Commands: what the network may ask of the pipeline.
struct SetLight {
  hal::Light light = {};
};
/// Within the ranges of Status::camera.settings.
struct SetCamera {
  hal::CameraChange change = {};
};
struct Rezero {
  bool force = false;  ///< Take the reference although in contact.
};
/// Made by Port::prepare().
struct UseCalibration {
  std::shared_ptr<const calibration::Calibration> calibration;
  /// The caller's own name for it, in every frame measured by it. 0: the one at start.
  std::uint64_t key = 0;
  std::shared_ptr<ActiveCalibration> prepared = {};  ///< When done: the one used before.
};
struct CopyReference {
  std::shared_ptr<ReferenceCopy> copy = {};  ///< Port::submit() makes it; filled when done.
};
/// How depth is made from now on; the reference stays. Made by Port::prepare_maps().
struct SetReconstruction {
  ReconstructionRules rules;
  std::shared_ptr<Resolutions> prepared = {};  ///< Null: uncalibrated. When done: those before.
};
/// The element of the command queues. It goes to the thread that executes it and comes back in one
/// CommandDone, so that its memory is allocated and freed on the network's side only.
struct Command {
  std::variant<SetLight, SetCamera, Rezero, UseCalibration, CopyReference, SetReconstruction> what;
  /// The caller's continuation, called when the CommandDone is fetched. The pipeline may keep
  /// the command longer than the caller lives: capture nothing that must not outlive the caller.
  std::function<void(const CommandDone&)> then = {};
};

// Events: what the pipeline reports to the network. Never lost: when the queue is full the pipeline
// keeps its state and reports later.
enum class Outcome : std::uint8_t {
  done,
  refused_contact,
  refused_unsteady,  ///< The image does not hold still long enough to be averaged.
  refused_dark,      ///< The image is too dark to be a reference.
  device_error,
  camera_away,
  ring_away,  ///< The light is kept and shown once there is a ring.
  uncalibrated,
  no_reference  ///< The reference is being taken.
};
struct CommandDone {
  Command command = {};
  Outcome outcome = Outcome::done;
  std::string message = {};  ///< Empty when done; else what happened and the fix.
  Stamp at = {};             ///< When a calibration or maps came into use.
  std::optional<std::int64_t> light_since_ns = {};  ///< Of SetLight, as DepthFrame's.
};
/// Contact begun or ended between two measured frames. Without measurement no event is sent, and
/// the earlier contact counts as held.
struct ContactChanged {
  bool in_contact = false;
  Stamp at = {};  ///< The frame that shows it.
  ContactSummary contact = {};
};
struct LightChanged {
  hal::Light light = {};
  Stamp at = {};
  std::optional<std::int64_t> since_ns = {};  ///< As DepthFrame::light_since_ns.
};
struct ReferenceTaken {
  bool restored = false;  ///< The last good one from the state directory, not a new one.
  Stamp at = {};          ///< The last frame in it.
};
struct StateChanged {
  State state = State::settling;
  HealthSet health = {};
  Stamp at = {};
};
using Event = std::variant<CommandDone, ContactChanged, LightChanged, ReferenceTaken, StateChanged>;

/// Where the times of a stage are counted up to, nanoseconds: 10 µs … 1 s.
inline constexpr std::array<std::int64_t, 16> kStageBoundsNs = {
    10'000,      20'000,      50'000,      100'000,      200'000,    500'000,
    1'000'000,   2'000'000,   5'000'000,   10'000'000,   20'000'000, 50'000'000,
    100'000'000, 200'000'000, 500'000'000, 1'000'000'000};

struct StageStatistics {
  std::string stage;
  double p50_us = 0;
  double p99_us = 0;
  double max_us = 0;
  std::uint64_t count = 0;
  double sum_us = 0;
  std::array<std::uint64_t, kStageBoundsNs.size()> within{};  ///< At most each of kStageBoundsNs.
};

/// What the kernel counted of a thread since its start.
struct ThreadUsage {
  std::uint64_t minor_faults = 0;  ///< Pages mapped without reading from a disk.
  std::uint64_t major_faults = 0;  ///< Pages read from a disk.
  std::uint64_t waits = 0;         ///< Voluntary context switches.
  std::uint64_t preemptions = 0;   ///< Involuntary context switches.
};

/// What `dtactctl status` shows.
struct Status {
  State state = State::settling;
  HealthSet health = {};
  hal::CameraInfo camera;
  hal::CameraReport camera_report;
  bool camera_damaged = false;  ///< What the camera sent last was damaged.
  hal::RingInfo ring;
  std::string ring_message;  ///< The ring's last error, or what to know; empty when well.
  hal::Light light = {};
  std::optional<std::int64_t> light_since_ns;  ///< As DepthFrame::light_since_ns.
  /// The light requested last, unless the ring failed to show it: what a partial update changes.
  hal::Light light_requested = {};
  std::shared_ptr<const calibration::Calibration> calibration;  ///< Null when uncalibrated.
  ReconstructionRules reconstruction;                           ///< In use.
  std::uint64_t frames = 0;                                     ///< Published since start.
  std::uint64_t skipped = 0;          ///< Published but replaced before the network fetched them.
  double fps = 0;                     ///< Over the last second.
  double camera_fps = 0;              ///< Measured by the camera's timestamps; 0 = unknown.
  std::optional<int> cpu;             ///< The capture thread is pinned to this CPU.
  std::vector<std::string> realtime;  ///< One sentence for each real-time setting refused.
  std::vector<StageStatistics> stages;
  /// How far the reference follows the light since it was taken: a share, negative = dimmer.
  double light_followed = 0;
  ThreadUsage capture_thread;  ///< Renewed once a second.
  /// How far the gel's marks lay from where they belong; meant while Health::camera_shifted is set.
  std::string camera_shift_message;
  double rezero_timeout_s = 0;  ///< The longest time that a re-zero takes, seconds.
  /// Why the calibration or the last good reference could not be used or kept, and what to do;
  /// empty when all is well.
  std::string storage_message;
};

/// What the network has use for. With nothing, frames are looked at for what reference, light and
/// health need, no depth is made and nothing is published.
struct Wanted {
  bool contact = false;  ///< Contact events, and the refusal to re-zero under contact.
  bool depth = false;    ///< Frames with depth or its summary; needs contact.
  bool luma = false;     ///< Frames with the camera's image.
  bool jpeg = false;     ///< Frames with the camera's own JPEG, if that is what it sends.
  bool operator==(const Wanted&) const = default;
};

/// The one seam between the network thread (the only caller, but for prepare() and prepare_maps())
/// and the pipeline's threads. No other call blocks.
class Port {
 public:
  Port() = default;
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;
  virtual ~Port() = default;

  /// Becomes readable when a frame or an event waits. The caller polls it, reads it empty
  /// (an eventfd), then calls latest() and next_event() until they have nothing more.
  [[nodiscard]] virtual int event_fd() const noexcept = 0;
  /// The newest frame not fetched yet, or null. Valid until the next call.
  [[nodiscard]] virtual const DepthFrame* latest() noexcept = 0;
  [[nodiscard]] virtual std::optional<Event> next_event() = 0;
  /// False: too many commands wait; ask again later.
  [[nodiscard]] virtual bool submit(Command command) = 0;
  /// Makes all that a calibration needs at run time. Takes up to a second, so it is meant for a
  /// worker thread; any thread. One change at a time: `rules` and the calibration in use must not
  /// change before the command is done. Throws std::invalid_argument with the fix.
  [[nodiscard]] virtual UseCalibration prepare(
      const std::shared_ptr<const calibration::Calibration>& calibration,
      const ReconstructionRules& rules) const = 0;
  /// Like prepare(), for the calibration in use, or null, with other rules: makes only the maps.
  [[nodiscard]] virtual SetReconstruction prepare_maps(
      const std::shared_ptr<const calibration::Calibration>& in_use,
      const ReconstructionRules& rules) const = 0;
  virtual void want(Wanted wanted) noexcept = 0;
  [[nodiscard]] virtual Status status() const = 0;
};

}  // namespace dtact::pipeline
