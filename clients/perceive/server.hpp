#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "clients/perceive/frame_maker.hpp"
#include "clients/perceive/upstream.hpp"
#include "daemon/serve/listeners.hpp"
#include "daemon/serve/session_list.hpp"

namespace dtact::perceive {

/// dtact-perceive as a whole: a client of the daemon, and a server of its own. All but the
/// connection to the daemon is on the thread that runs `io`.
class Server : public net::SessionHost, public std::enable_shared_from_this<Server> {
 public:
  /// Listens from here on; `object` and `taught` as FrameMaker takes them. Throws
  /// std::runtime_error naming the setting, address or port and the fix.
  Server(boost::asio::io_context& io, net::NetConfig config, client::Options daemon,
         const std::shared_ptr<const ObjectModel>& object = nullptr,
         const std::filesystem::path& taught = {});

  void start();
  void stop();
  /// Reads certificate, key and tokens again. Throws as the constructor, and changes nothing then.
  void reload();
  [[nodiscard]] std::vector<std::string> addresses() const { return listeners_.addresses(); }
  /// The TCP port it listens on; 0 without TCP.
  [[nodiscard]] std::uint16_t port() const { return listeners_.port(); }

  void introduce(v1::HelloReply& reply) const override;
  void on_authenticated() override { update_want(); }
  void on_request(const std::shared_ptr<net::Session>& session,
                  const v1::ClientMessage& message) override;
  void on_closed(const net::Session& session) override;

 private:
  void on_frame();
  /// Asks the daemon for what the clients need now.
  void update_want();
  void subscribe(const std::shared_ptr<net::Session>& session, std::uint64_t id,
                 const v1::Subscribe& request);
  /// What the daemon last said of itself; empty before it was reached.
  [[nodiscard]] v1::HelloReply daemon() const;
  void fill(v1::Status& status) const;

  boost::asio::io_context& io_;
  net::Listeners listeners_;
  net::SessionList session_list_;
  FrameMaker maker_;
  std::unique_ptr<Upstream> upstream_;
  client::Options daemon_;
  v1::Subscribe wanted_;
  FrameMaker::Wanted extras_;  ///< What clients need beside points.
  bool in_contact_ = false;    ///< In the last frame.
  double mm_per_px_ = 0;       ///< Of the last whole map.
  std::string damage_;         ///< Why the last frame could not be read; empty if it could.
  std::uint64_t frames_ = 0;
  std::uint64_t skipped_ = 0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace dtact::perceive
