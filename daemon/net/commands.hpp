#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <memory>

#include "daemon/net/calibration_commands.hpp"
#include "daemon/net/overview.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/session.hpp"

namespace dtact::v1 {
class SetCamera;
class SetLight;
class Subscribe;
}  // namespace dtact::v1

namespace dtact::net {

class Hub;

/// What clients may ask for: checks requests, passes them to the pipeline or, about calibrations,
/// to CalibrationCommands, and sends each one answer. All on the network thread.
class Commands {
 public:
  Commands(boost::asio::io_context& io, boost::asio::thread_pool& worker, const NetConfig& config,
           Hub& hub, pipeline::Port& port, CalibrationStore& store);

  void on_request(const std::shared_ptr<Session>& session, const v1::ClientMessage& message);
  [[nodiscard]] Overview overview() const;

 private:
  void subscribe(const Requester& requester, const v1::Subscribe& request);
  /// The last writer wins. A partial update changes the light that was requested last.
  void set_light(const Requester& requester, const v1::SetLight& request);
  void set_camera(const Requester& requester, const v1::SetCamera& request);
  void rezero(const Requester& requester, bool force);
  void get_status(const Requester& requester);
  void ping(const Requester& requester);

  class Thermometer;

  const NetConfig& config_;
  Hub& hub_;
  pipeline::Port& port_;
  std::shared_ptr<CalibrationCommands> calibrations_;
  std::shared_ptr<Thermometer> thermometer_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace dtact::net
