#pragma once

#include <chrono>
#include <optional>

#include "clients/cpp/client.hpp"

namespace dtact::ctl::guided {

/// The session's view of a running daemon; the tests play one. Calls throw like client::Client.
class Sensor {
 public:
  Sensor() = default;
  Sensor(const Sensor&) = delete;
  Sensor& operator=(const Sensor&) = delete;
  virtual ~Sensor() = default;

  [[nodiscard]] virtual std::string program() const = 0;  ///< "dtactd 0.1.0"
  [[nodiscard]] virtual v1::Status status() = 0;
  /// The next frame with luma; nothing when none came in time.
  [[nodiscard]] virtual std::optional<v1::Frame> next(std::chrono::milliseconds timeout) = 0;
  virtual void upload(const v1::UploadCalibration& files) = 0;
};

/// A daemon behind a connection, subscribed to its luma.
class LiveSensor : public Sensor {
 public:
  explicit LiveSensor(const client::Options& target);

  [[nodiscard]] std::string program() const override { return client_.server().program(); }
  [[nodiscard]] v1::Status status() override { return client_.status(); }
  [[nodiscard]] std::optional<v1::Frame> next(std::chrono::milliseconds timeout) override;
  void upload(const v1::UploadCalibration& files) override { client_.upload_calibration(files); }

 private:
  client::Client client_;
};

}  // namespace dtact::ctl::guided
