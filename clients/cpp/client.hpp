#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "clients/cpp/errors.hpp"
#include "proto/defaults.hpp"
#include "proto/dtact.pb.h"

namespace dtact::client {

/// The number of the calibration that the daemon's configuration names. Uploaded ones count from 1.
inline constexpr std::uint64_t kConfiguredCalibration = 0;

/// Depth as it is, of every frame.
[[nodiscard]] v1::Subscribe depth_stream();

struct Options {
  std::string host = wire::kDefaultAddress;  ///< Name or address.
  std::uint16_t port = wire::kDefaultPort;
  std::string program = "dtact C++ client";  ///< Shown by dtactctl status; at most 64 bytes.
  std::chrono::milliseconds timeout{5000};   ///< Of the connection and of each request.
};

/// A connection to dtactd. What it takes and gives are the messages of dtact.proto, where their
/// fields are explained; maps.hpp reads the pixels of the maps. Calls wait; one thread at a time.
/// After a ConnectionError the object is of no further use: whoever wants to go on makes another
/// one.
class Client {
 public:
  /// Connects and agrees on the version. Throws ConnectionError or ProtocolError.
  explicit Client(const Options& options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  /// Who answered.
  [[nodiscard]] const v1::HelloReply& server() const noexcept;
  /// The daemon runs on this machine, so that its CLOCK_MONOTONIC is ours.
  [[nodiscard]] bool same_machine() const noexcept;

  // Requests. Each throws Refused with the daemon's sentence, or a ConnectionError. Frames and
  // events that arrive meanwhile are kept for next(): every event, and the newest few frames.

  /// Replaces the subscription. Events come in any case.
  void subscribe(const v1::Subscribe& subscription = depth_stream());
  /// Returns the light once the ring shows it.
  v1::LightState set_light(const v1::SetLight& change);
  /// Takes the present image as untouched; `force`: although something touches.
  void rezero(bool force = false);
  [[nodiscard]] v1::Status status();
  /// The files of one calibration; without a number, of the current one.
  [[nodiscard]] v1::CalibrationFiles calibration(
      std::optional<std::uint64_t> number = std::nullopt);
  /// All that the daemon has: the configured one, then the uploaded ones, oldest first. Each is
  /// read and checked for this; may take a few seconds. Of an older daemon, which does not say what
  /// is in use, the current one is taken to be.
  [[nodiscard]] std::vector<v1::StoredCalibration> calibrations();
  /// Returns once the daemon uses and has stored it, with its number; nothing from a daemon that is
  /// too old to say it. May take a few seconds.
  std::optional<std::uint64_t> upload_calibration(const v1::UploadCalibration& files);
  /// Makes one of calibrations() current. Returns once the daemon uses it and will start with it.
  void activate_calibration(std::uint64_t number);

  /// The next frame or event; nothing when none came in time. Throws a ConnectionError.
  [[nodiscard]] std::optional<std::variant<v1::Frame, v1::Event>> next(
      std::chrono::milliseconds timeout);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::client
