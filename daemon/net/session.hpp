#pragma once

#include <array>
#include <boost/asio/steady_timer.hpp>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/net/frame_encoder.hpp"
#include "daemon/net/net_config.hpp"
#include "daemon/net/outbox.hpp"
#include "daemon/net/transport.hpp"
#include "proto/framing.hpp"

namespace dtact::v1 {
class ClientMessage;
class Hello;
class ServerMessage;
}  // namespace dtact::v1

namespace dtact::net {

class Session;

/// Whom a session tells. Sessions hold it weakly: it may go first.
class SessionHost {
 public:
  SessionHost() = default;
  SessionHost(const SessionHost&) = delete;
  SessionHost& operator=(const SessionHost&) = delete;
  virtual ~SessionHost() = default;

  /// The handshake is over: events and, once subscribed, frames flow.
  virtual void on_greeted() = 0;
  /// A request after the handshake, its id checked. Every one is owed exactly one reply.
  virtual void on_request(const std::shared_ptr<Session>& session,
                          const v1::ClientMessage& message) = 0;
  /// The connection has ended; nothing more comes of this session.
  virtual void on_closed(const Session& session) = 0;
};

/// What a client wants, see dtact.v1.Subscribe.
struct Subscription {
  bool active = false;
  FrameKind kind;
  std::uint32_t every = 1;  ///< Every n-th frame.
};

/// One client: handshake and requests in; answers, events and frames out through its outbox. A
/// client whose outbox takes no more is disconnected. All on the network thread.
class Session : public std::enable_shared_from_this<Session>, private Outbox::Owner {
 public:
  Session(std::unique_ptr<Transport> transport, const NetConfig& config,
          std::weak_ptr<SessionHost> host);

  /// Waits for Hello.
  void start();
  /// Instead of start(): says why and ends.
  void refuse(int error_code, const std::string& sentence);

  /// Answers and events.
  void send(const v1::ServerMessage& message);
  void reply_error(std::uint64_t id, int error_code, const std::string& sentence);
  /// A frame of this client's kind.
  void send_frame(std::shared_ptr<const EncodedFrame> frame);
  /// One more frame came out of the pipeline, after `missed` that nobody fetched. True when this
  /// client is to get it.
  [[nodiscard]] bool is_due(std::uint64_t missed) noexcept;
  void subscribe(const Subscription& subscription) noexcept;
  /// Ends the connection now. The host is told.
  void close(const std::string& reason, LogLevel level = LogLevel::info);

  [[nodiscard]] const Subscription& subscription() const noexcept { return subscription_; }
  [[nodiscard]] bool greeted() const noexcept { return state_ == State::greeted; }
  [[nodiscard]] const Peer& peer() const noexcept { return transport_->peer(); }
  [[nodiscard]] const std::string& program() const noexcept { return program_; }
  [[nodiscard]] const Outbox& outbox() const noexcept { return outbox_; }

 private:
  enum class State : std::uint8_t {
    fresh,    ///< Hello has not come.
    greeted,  ///< Requests and frames flow.
    ending,   ///< What is queued is sent, what comes is thrown away, then the connection ends.
    closed
  };

  void arm_timer(std::chrono::milliseconds after, const char* reason);
  void read();
  void take(std::string_view input);
  void on_message(const std::string& bytes);
  void on_hello(std::uint64_t id, const v1::Hello& hello);
  /// Sends an error as the last answer and ends.
  void end_with(std::uint64_t id, int error_code, const std::string& sentence);
  std::shared_ptr<void> hold() override { return shared_from_this(); }
  void on_write_failed(const std::string& reason) override { close(reason); }

  std::unique_ptr<Transport> transport_;
  Outbox outbox_;
  boost::asio::steady_timer timer_;
  const NetConfig& config_;
  std::weak_ptr<SessionHost> host_;
  std::string program_;
  State state_ = State::fresh;
  Subscription subscription_;
  std::uint64_t offered_ = 0;  ///< Frames of the pipeline since the subscription, for `every`.

  std::array<char, 16384> input_{};
  wire::MessageDecoder decoder_;
};

}  // namespace dtact::net
