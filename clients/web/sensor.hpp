#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "clients/web/source.hpp"
#include "clients/web/wire_transport.hpp"
#include "daemon/serve/admission.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/session.hpp"
#include "daemon/serve/session_list.hpp"
#include "daemon/serve/token_bucket.hpp"

namespace dtact::web {

/// The viewers of one daemon: clients of its wire over WebSockets, who stay while it is away. On
/// the thread that runs `io`.
class Sensor : public net::SessionHost, public std::enable_shared_from_this<Sensor> {
 public:
  /// What is passed by reference must outlive it.
  Sensor(boost::asio::io_context& io, std::shared_ptr<Source> source, const net::NetConfig& config,
         net::Admission& admission);

  void start();
  void stop();
  /// Ends the viewers whose token was revoked or has other rights now.
  void end_revoked() const { session_list_.end_revoked(); }
  /// A new viewer.
  /// A connection that is not authenticated yet; `place`: see Upgrade::open.
  void admit(std::shared_ptr<WebSocket> socket, net::Peer peer, std::shared_ptr<void> place);
  /// The sensor's entry of /sensors, see README.md in this folder.
  [[nodiscard]] std::string entry() const;
  /// The sensor's entry of /fleet: the same with its status, where that came in the last
  /// kMaxStatusAge.
  [[nodiscard]] std::string entry_with_status(
      std::chrono::steady_clock::time_point now = std::chrono::steady_clock::now()) const;
  /// Asks the daemon for its status, at most once a second however many viewers there are.
  void ask_status();
  [[nodiscard]] const std::shared_ptr<Source>& source() const noexcept { return source_; }

  void introduce(v1::HelloReply& reply) const override;
  void on_authenticated() override {}
  void on_request(const std::shared_ptr<net::Session>& session,
                  const v1::ClientMessage& message) override;
  void on_closed(const net::Session& session) override;

 private:
  /// Requests a second of one viewer, and as many at once after a rest.
  static constexpr double kMaxRequestsPerS = 100;
  static constexpr std::chrono::seconds kMaxStatusAge{5};

  struct Viewer {
    WireTransport* transport = nullptr;  ///< The session's.
    std::uint32_t waiting = 0;           ///< RelayedFrame::parts of the frame that waits.
    net::TokenBucket requests{kMaxRequestsPerS, kMaxRequestsPerS};
    // Its Subscribes, counted: answers come in any order, and the newest one holds.
    std::uint64_t asked = 0;
    std::uint64_t accepted = 0;
  };

  void on_changed();
  void subscribe(const std::shared_ptr<net::Session>& session, std::uint64_t id,
                 const v1::Subscribe& request);
  void on_frame(net::Session& session, const RelayedFrame& frame, std::uint64_t missed);

  boost::asio::io_context& io_;
  std::shared_ptr<Source> source_;
  const net::NetConfig& config_;
  net::Admission& admission_;
  net::SessionList session_list_;
  std::map<const net::Session*, Viewer> viewers_;
  std::string status_;  ///< In JSON; empty: not known.
  std::chrono::steady_clock::time_point status_came_;
  std::chrono::steady_clock::time_point status_asked_;
};

}  // namespace dtact::web
