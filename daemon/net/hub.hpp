#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/net/frame_encoder.hpp"
#include "daemon/net/overview.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/security.hpp"
#include "daemon/serve/session.hpp"
#include "daemon/serve/session_list.hpp"

namespace dtact::net {

class Commands;

/// Connects the pipeline with the clients: fetches events and frames when the pipeline signals
/// them, encodes each frame once for each kind that is due to a client, and sends every client
/// the same buffer. Also keeps the list of clients. All on the network thread.
class Hub : public SessionHost, public std::enable_shared_from_this<Hub> {
 public:
  /// Throws std::system_error when the pipeline's event descriptor cannot be watched.
  Hub(boost::asio::io_context& io, const NetConfig& config, pipeline::Port& port);

  /// `commands` executes what clients request, until stop().
  void start(Commands& commands);
  /// Ends every connection and stops watching the pipeline.
  void stop();

  /// A new connection.
  void admit(const std::shared_ptr<Session>& session);
  /// Ends the clients whose token was revoked or has other rights now.
  void end_revoked() const { session_list_.end_revoked(); }
  /// To every authenticated client that wants events.
  void broadcast(const v1::ServerMessage& event) { session_list_.broadcast(event); }
  /// What the calibration is called on the wire that the pipeline knows by this key.
  void number_calibration(std::uint64_t key, std::uint64_t number) { numbers_[key] = number; }
  [[nodiscard]] std::optional<std::uint64_t> calibration_number(
      std::optional<std::uint64_t> key) const;
  /// Call after a client's subscription changed. Requests from the pipeline what all clients need,
  /// and frees what is no longer needed.
  void update_want();
  [[nodiscard]] const std::vector<std::shared_ptr<Session>>& sessions() const noexcept {
    return session_list_.all();
  }

  /// Where the daemon listens, for status.
  void set_endpoints(std::vector<EndpointInfo> endpoints) { endpoints_ = std::move(endpoints); }
  [[nodiscard]] const std::vector<EndpointInfo>& endpoints() const noexcept { return endpoints_; }

  /// Percentiles of what happens to a frame on this thread.
  [[nodiscard]] std::vector<pipeline::StageStatistics> stages() const;
  /// All clients together since start, those that left included.
  [[nodiscard]] Traffic traffic() const;
  /// When the reference image in use was taken, CLOCK_MONOTONIC; nothing while there is none, and
  /// for one of an earlier run.
  [[nodiscard]] std::optional<std::int64_t> reference_taken_ns() const noexcept {
    return reference_taken_ns_;
  }
  /// Frame messages encoded since start.
  [[nodiscard]] std::uint64_t encoded() const noexcept { return encoder_.times().count(); }

  void on_request(const std::shared_ptr<Session>& session,
                  const v1::ClientMessage& message) override;
  /// The camera's serial, if known.
  [[nodiscard]] std::string serial() const;
  void introduce(v1::HelloReply& reply) const override;
  void on_authenticated() override { update_want(); }
  void on_closed(const Session& session) override;

 private:
  void wait();
  void drain();
  void on_event(const pipeline::Event& event);
  void on_frame(const pipeline::DepthFrame& frame);

  boost::asio::io_context& io_;
  const NetConfig& config_;
  pipeline::Port& port_;
  boost::asio::posix::stream_descriptor events_;
  FrameEncoder encoder_;
  pipeline::Histogram handover_;  ///< From published until fetched here.
  Commands* commands_ = nullptr;  // while started
  SessionList session_list_;
  std::vector<EndpointInfo> endpoints_;
  std::map<std::uint64_t, std::uint64_t> numbers_;  ///< By key, of those still in use.
  std::uint64_t number_ = 0;  ///< DepthFrame::number of the last frame; 0: none came yet.
  bool reported_too_large_ = false;
  Traffic gone_;  ///< Traffic of closed sessions, and the count of all connections.
  std::optional<std::int64_t> reference_taken_ns_;
};

}  // namespace dtact::net
