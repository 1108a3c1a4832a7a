#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "daemon/net/calibration_commands.hpp"
#include "daemon/net/overview.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/session.hpp"

namespace dtact::v1 {
class SetLight;
class SetReconstruction;
class Subscribe;
}  // namespace dtact::v1

namespace dtact::net {

class Hub;

/// What clients may ask for: checks requests, passes them to the pipeline or, about calibrations,
/// to CalibrationCommands, and sends each one answer. All on the network thread.
///
/// The light: the last writer wins. A partial update changes the light that was asked for last,
/// also while the ring has not shown it yet.
class Commands {
 public:
  Commands(boost::asio::io_context& io, boost::asio::thread_pool& worker, const NetConfig& config,
           Hub& hub, pipeline::Port& port, CalibrationStore& store);

  void on_request(const std::shared_ptr<Session>& session, const v1::ClientMessage& message);
  void on_done(const pipeline::CommandDone& done);
  /// The ring shows another light.
  void on_light(const hal::Light& light);
  [[nodiscard]] Overview overview() const;

 private:
  using Who = CalibrationCommands::Who;
  /// A request that the pipeline is working on.
  struct Pending {
    std::weak_ptr<Session> session;
    std::uint64_t id = 0;
    struct Rezero {};
    std::variant<Rezero, hal::Light, pipeline::ReconstructionRules, CalibrationCommands::Change,
                 CalibrationCommands::ReferenceWanted>
        what;
  };

  void subscribe(const Who& who, const v1::Subscribe& request);
  void set_light(const Who& who, const v1::SetLight& request);
  void rezero(const Who& who, bool force);
  void get_status(const Who& who);
  void ping(const Who& who);
  void set_reconstruction(const Who& who, const v1::SetReconstruction& request);
  void tell_reconstruction(const pipeline::ReconstructionRules& rules, const pipeline::Stamp& at);
  /// False, with the answer sent, when the pipeline cannot take another command.
  [[nodiscard]] bool submit(const Who& who, decltype(pipeline::Command::what) command,
                            decltype(Pending::what) what);

  const NetConfig& config_;
  Hub& hub_;
  pipeline::Port& port_;
  std::shared_ptr<CalibrationCommands> calibrations_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::map<std::uint64_t, Pending> pending_;  ///< By ticket. The pipeline bounds how many.
  std::uint64_t next_ticket_ = 1;
  std::optional<hal::Light> light_;  ///< Asked for last; empty: what the ring shows.
  int lights_pending_ = 0;
};

}  // namespace dtact::net
