#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "clients/cpp/errors.hpp"
#include "clients/cpp/types.hpp"
#include "proto/defaults.hpp"

namespace dtact::client {

enum class Depth { none = 0, int16 = 1, delta_zstd = 2 };  ///< The wire's DepthEncoding.
enum class Luma { none = 0, grey8 = 1 };                   ///< The wire's LumaEncoding.

/// What frames are to hold. Neither map and no summary: no frames.
struct Subscription {
  Depth depth = Depth::int16;
  Luma luma = Luma::none;
  std::uint32_t every = 1;  ///< Every n-th frame.
  bool summary = false;     ///< Contact, health and times only, whatever the maps say.
};

/// What is empty stays as it is.
struct LightChange {
  std::optional<int> brightness;      ///< 0 … 255
  std::optional<std::string> scheme;  ///< "all", "scheme1" … "scheme4"
  std::vector<Rgb> leds;              ///< Eight, or empty. After `scheme`.
};

struct Options {
  std::string host = wire::kDefaultAddress;  ///< Name or address.
  std::uint16_t port = wire::kDefaultPort;
  std::string program = "dtact C++ client";  ///< Shown by dtactctl status; at most 64 bytes.
  std::chrono::milliseconds timeout{5000};   ///< Of the connection and of each request.
};

/// A connection to dtactd. Calls wait; one thread at a time. After a ConnectionError the object is
/// of no further use: whoever wants to go on makes another one.
class Client {
 public:
  /// Connects and agrees on the version. Throws ConnectionError or ProtocolError.
  explicit Client(const Options& options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  [[nodiscard]] const ServerInfo& server() const noexcept;
  /// The daemon runs on this machine, so that its CLOCK_MONOTONIC is ours.
  [[nodiscard]] bool same_machine() const noexcept;

  // Requests. Each throws Refused with the daemon's sentence, or a ConnectionError. Frames and
  // events that arrive meanwhile are kept for next(): every event, and the newest few frames.

  /// Replaces the subscription. Events come in any case.
  void subscribe(const Subscription& subscription);
  /// Returns the light once the ring shows it.
  Light set_light(const LightChange& change);
  /// Takes the present image as untouched; `force`: although something touches.
  void rezero(bool force = false);
  [[nodiscard]] Status status();
  /// The files of one calibration; without a number, of the current one.
  [[nodiscard]] CalibrationFiles calibration(std::optional<std::uint64_t> number = std::nullopt);
  /// All that the daemon has: the configured one, then the uploaded ones, oldest first. Each is
  /// read and checked for this; may take a few seconds.
  [[nodiscard]] std::vector<StoredCalibration> calibrations();
  /// Returns once the daemon uses and has stored it, with its number; nothing from a daemon that is
  /// too old to say it. May take a few seconds.
  std::optional<std::uint64_t> upload_calibration(const CalibrationFiles& files);
  /// Makes one of calibrations() current. Returns once the daemon uses it and will start with it.
  void activate_calibration(std::uint64_t number);

  /// The next frame or event; nothing when none came in time. Throws a ConnectionError, also for
  /// maps that cannot be decoded.
  [[nodiscard]] std::optional<std::variant<Frame, Event>> next(std::chrono::milliseconds timeout);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::client
