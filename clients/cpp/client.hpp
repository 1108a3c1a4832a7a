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

/// Depth as it is, of every frame.
DTACT_EXPORT [[nodiscard]] v1::Subscribe depth_stream();

/// The connection was lost and is there again, subscribed as before. What happened meanwhile was
/// not seen: ask status() for what events would have told. Client::server() may be another daemon.
struct Reconnected {
  std::string reason;  ///< Why it was lost: a sentence.
  std::chrono::milliseconds away{};
  /// Of the last frame before; 0 = none. The camera's frames between it and the next one's were
  /// missed; a sequence that is not greater is that of a daemon or camera that began anew.
  std::uint64_t last_sequence = 0;
};

using Item = std::variant<v1::Frame, v1::Event, Reconnected>;

/// What run() calls. Those left empty are not called.
struct Handlers {
  std::function<void(const v1::Frame&)> frame;
  std::function<void(const v1::Event&)> event;
  std::function<void(const Reconnected&)> reconnected;
};

/// A connection to dtactd. What it takes and gives are the messages of dtact.proto, where their
/// fields, units and signs are explained; maps.hpp reads the pixels of the maps.
///
/// Calls wait, on the caller's thread; the library has none of its own and no state outside of its
/// objects. One thread at a time may use a Client; different Clients know nothing of each other.
class DTACT_EXPORT Client {
 public:
  /// Connects, verifies the daemon where Options ask for it, and agrees on the version. Throws
  /// Error for options that make no sense, ConnectionError or one of its kinds, and Refused when
  /// the daemon denies the token. Tries once, also with Options::reconnect.
  explicit Client(const Options& options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  /// Who answered. Renewed by a reconnection.
  [[nodiscard]] const v1::HelloReply& server() const noexcept;
  /// HelloReply.features lists `name`; proto/README.md has the names: "reference", "cloud".
  [[nodiscard]] bool has_feature(const std::string& name) const;
  /// The daemon runs on this machine, so that its CLOCK_MONOTONIC is ours.
  [[nodiscard]] bool same_machine() const noexcept;

  // Requests. Each throws Refused with the daemon's sentence, TimeoutError, or a ConnectionError,
  // after which it is not known whether the daemon has done it. None is sent twice. While a lost
  // connection is to be made again, a request tries that once when the next attempt is due, and
  // throws at once before. Frames and events that arrive meanwhile are kept for next(): every
  // event, and the newest few frames.

  /// Replaces the subscription, also for connections to come.
  void subscribe(const v1::Subscribe& subscription = depth_stream());
  /// Returns the light once the ring shows it.
  v1::LightState set_light(const v1::SetLight& change);
  /// Takes the present image as the reference; `force`: although something is in contact. Waits for
  /// the frames that the daemon averages, on top of Options::timeout.
  void rezero(bool force = false);
  /// How depth is made from now on; returns it once frames are made so.
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
  /// All that the daemon has: the configured one, then the uploaded ones, oldest first. The
  /// daemon reads and checks those that it does not know yet; may take a few seconds.
  [[nodiscard]] std::vector<v1::StoredCalibration> calibrations();
  /// Returns once the daemon uses and has stored it, with its number. May take a few seconds.
  std::uint64_t upload_calibration(const v1::UploadCalibration& files);
  /// Makes one of calibrations() current. Returns once the daemon uses it and will start with it.
  void activate_calibration(std::uint64_t number);

  /// The next frame, event or reconnection; nothing when none came in time. Without
  /// Options::reconnect it throws a ConnectionError when the connection is lost. With it, it makes
  /// the connection again, whose last attempt may last for Options::timeout beyond `timeout`, and
  /// throws what more attempts cannot fix: ProtocolError, IdentityError, and Refused when the
  /// daemon no longer grants the token or the subscription. Called again, it tries again.
  [[nodiscard]] std::optional<Item> next(std::chrono::milliseconds timeout);
  /// next() and the handler for it, again and again on this thread, until `stop` is requested,
  /// which ends the wait at once. Handlers may use the client. Throws what next() and the handlers
  /// throw.
  void run(const Handlers& handlers, const std::stop_token& stop);
  /// For an event loop of one's own: whenever this descriptor can be read, call next() with a
  /// time-out of 0 until it returns nothing. −1 while the connection is lost: call next() now and
  /// then, and ask for the descriptor again.
  [[nodiscard]] int native_handle() const noexcept;

 private:
  std::unique_ptr<Session> session_;
};

}  // namespace dtact::client
