#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <variant>
#include <vector>

#include "clients/cpp/errors.hpp"
#include "clients/cpp/export.hpp"
#include "clients/cpp/options.hpp"
#include "proto/dtact.pb.h"

namespace dtact::client {

class Session;

/// The number of the calibration that the daemon's configuration names. Uploaded ones count from 1.
inline constexpr std::uint64_t kConfiguredCalibration = 0;

/// Subscribes to the unreduced depth of every frame.
DTACT_EXPORT [[nodiscard]] v1::Subscribe depth_stream();

/// The connection was lost and is restored, subscribed as before. Events in between are missing;
/// status() returns the present state. Client::server() may be another daemon.
struct Reconnected {
  std::string reason;  ///< Why it was lost: a sentence.
  std::chrono::milliseconds away{};
  /// Sequence of the last frame before the loss; 0: none. Frames between it and the next one's
  /// were missed. If the next sequence is not greater, the daemon or the camera has restarted.
  std::uint64_t last_sequence = 0;
};

using Item = std::variant<v1::Frame, v1::Event, Reconnected>;

/// Callbacks of run(). Empty ones are not called.
struct Handlers {
  std::function<void(const v1::Frame&)> frame;
  std::function<void(const v1::Event&)> event;
  std::function<void(const Reconnected&)> reconnected;
};

/// A connection to dtactd. It uses the messages of dtact.proto, which explains fields, units and
/// signs; maps.hpp reads the pixels of the maps.
///
/// Calls block the caller's thread. The library has no threads of its own and no state outside its
/// objects. One thread at a time may use a Client, in the process that made it; the other's call
/// throws Error. Different Clients are independent.
class DTACT_EXPORT Client {
 public:
  /// Connects, verifies the daemon where Options ask for it, and agrees on the version. Throws
  /// Error for options that make no sense, ConnectionError or one of its kinds, and Refused when
  /// the daemon denies the token. Tries once, also with Options::reconnect.
  explicit Client(const Options& options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  /// The daemon's reply to Hello. Updated at each reconnection.
  [[nodiscard]] const v1::HelloReply& server() const noexcept;
  /// HelloReply.features lists `name`; proto/README.md has the names: "reference", "cloud".
  [[nodiscard]] bool has_feature(const std::string& name) const;
  /// The daemon runs on this machine, so that its CLOCK_MONOTONIC is ours.
  [[nodiscard]] bool same_machine() const noexcept;

  // Requests. Each throws Refused with the daemon's message, TimeoutError or ConnectionError. After
  // the last two it is unknown whether the daemon executed it. No request is sent twice. While the
  // connection is lost, a request tries to reconnect once if the next attempt is due, else it
  // throws at once. Frames and events that arrive meanwhile are kept for next(): all events, and
  // the newest few frames.

  /// Replaces the subscription, also for connections to come.
  void subscribe(const v1::Subscribe& subscription = depth_stream());
  /// Returns the light once the ring shows it.
  v1::LightState set_light(const v1::SetLight& change);
  /// Takes a new reference image; `force`: even in contact. Waits for the frames that the daemon
  /// averages, on top of Options::timeout.
  void rezero(bool force = false);
  /// Changes exposure and gain of the camera. Returns both as the camera has them then.
  v1::CameraSettings set_camera(const v1::SetCamera& change);
  /// Changes how depth is reconstructed. Returns the settings once frames use them.
  v1::Reconstruction set_reconstruction(const v1::SetReconstruction& change);
  [[nodiscard]] v1::Status status();
  /// The reference image that depth is measured against: a 16-bit grey PNG of the camera's size,
  /// 256 units a grey level.
  [[nodiscard]] v1::ReferenceImage reference();
  /// The daemon's clocks, nanoseconds.
  v1::Pong ping();
  /// The files of one calibration; without a number, of the current one.
  [[nodiscard]] v1::CalibrationFiles calibration(
      std::optional<std::uint64_t> number = std::nullopt);
  /// All calibrations of the daemon: the configured one, then the uploaded ones, oldest first. May
  /// take a few seconds, because the daemon reads and checks those that it does not know yet.
  [[nodiscard]] std::vector<v1::StoredCalibration> calibrations();
  /// Returns once the daemon uses and has stored it, with its number and those that the daemon has
  /// removed. May take a few seconds.
  v1::Done upload_calibration(const v1::UploadCalibration& files);
  /// Makes one of calibrations() current. Returns once the daemon uses it, also after a restart.
  void activate_calibration(std::uint64_t number);
  /// A pinned calibration is not removed, whatever is uploaded later.
  void pin_calibration(std::uint64_t number, bool pinned = true);

  /// The next frame, event or reconnection; nothing when none came in time. Throws ConnectionError
  /// when the connection is lost, without Options::reconnect. With it, next() reconnects; the last
  /// attempt may exceed `timeout` by Options::timeout. It throws what more attempts cannot fix:
  /// ProtocolError, IdentityError, and Refused when the daemon no longer grants the token or the
  /// subscription. The next call tries again.
  [[nodiscard]] std::optional<Item> next(std::chrono::milliseconds timeout);
  /// Calls next() and its handler in a loop on this thread until `stop` is requested, which ends
  /// the wait at once. Handlers may use the client. Passes on exceptions of next() and of the
  /// handlers.
  void run(const Handlers& handlers, const std::stop_token& stop);
  /// For your own event loop: whenever this descriptor is readable, call next() with a time-out of
  /// 0 until it returns nothing. −1 while the connection is lost: then call next() now and then,
  /// and get the descriptor again.
  [[nodiscard]] int native_handle() const noexcept;

 private:
  std::unique_ptr<Session> session_;
};

}  // namespace dtact::client
