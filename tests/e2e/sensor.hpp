#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/cpp/client.hpp"
#include "tests/e2e/daemon_process.hpp"

namespace dtact::e2e {

/// The rectangle of the simulated 800×600 image that the depth map shows: wider than high, so that
/// swapped axes show.
inline constexpr int kCropWidth = 500;
inline constexpr int kCropHeight = 400;
inline constexpr int kCropColumn = (800 - kCropWidth) / 2;
inline constexpr int kCropRow = (600 - kCropHeight) / 2;
/// The same for dtact-calibrate.
inline constexpr const char* kCrop = "500,400";

/// A calibration folder of the simulated sensor, made once per test program the way a user makes
/// it: images of the scene calibrate_ball.toml and `dtact-calibrate depth`, without the
/// simulator's truth.
const std::filesystem::path& calibration_folder();

std::filesystem::path scene_file(const std::string& name);

/// A daemon on the simulated sensor with a state folder, port and temp files of its own.
struct Sensor {
  /// `scene` empty: the built-in one. `settings`: further KEY=VALUE. `environment`: of the daemon.
  /// `tls`: of its clients.
  explicit Sensor(const std::filesystem::path& scene = {}, bool calibrated = true,
                  const std::vector<std::string>& settings = {}, Environment environment = {},
                  std::optional<client::Tls> tls = {});
  Sensor(const Sensor&) = delete;
  Sensor& operator=(const Sensor&) = delete;

  /// How clients reach the daemon.
  [[nodiscard]] client::Options options() const;
  [[nodiscard]] client::Client connect(const std::string& program = "e2e") const;
  /// Ends the daemon and starts it again on the same state folder.
  void restart();

  TempFolder folder;
  std::vector<std::string> arguments;
  Environment environment;
  std::optional<client::Tls> tls;
  std::unique_ptr<DaemonProcess> daemon;
};

using client::Item;

/// Reads until `done` returns true for an item. False when that takes longer than `patience`.
bool read_until(client::Client& client, const std::function<bool(const Item&)>& done,
                std::chrono::seconds patience = std::chrono::seconds(30));

bool has(const google::protobuf::RepeatedField<int>& health, v1::Health flag);

}  // namespace dtact::e2e
