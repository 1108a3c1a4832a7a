#pragma once

#include <boost/asio/steady_timer.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/serve/admission.hpp"
#include "daemon/serve/encoded_frame.hpp"
#include "daemon/serve/frame_kind.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/outbox.hpp"
#include "daemon/serve/subscription.hpp"
#include "daemon/serve/token_bucket.hpp"
#include "daemon/serve/transport.hpp"
#include "proto/framing.hpp"

namespace dtact::v1 {
class ClientMessage;
class Hello;
class HelloReply;
class ServerMessage;
}  // namespace dtact::v1

namespace dtact::net {

class Session;

/// The observer of sessions. Sessions hold it weakly: it may be destroyed first.
class SessionHost {
 public:
  SessionHost() = default;
  SessionHost(const SessionHost&) = delete;
  SessionHost& operator=(const SessionHost&) = delete;
  virtual ~SessionHost() = default;

  /// Adds to the answer to Hello what the settings do not know: the camera's serial number, or all
  /// that another daemon says of itself.
  virtual void introduce(v1::HelloReply& reply) const = 0;
  /// The handshake is over: events and, once subscribed, frames flow.
  virtual void on_authenticated() = 0;
  /// A request after the handshake, its id checked. Every one is owed exactly one reply.
  virtual void on_request(const std::shared_ptr<Session>& session,
                          const v1::ClientMessage& message) = 0;
  /// The connection has ended; nothing more comes of this session.
  virtual void on_closed(const Session& session) = 0;
};

/// One client: handshake and requests in; answers, events and frames out through its outbox. A
/// client whose outbox takes no more is disconnected. All on the network thread.
class Session : public std::enable_shared_from_this<Session>, private Outbox::Owner {
 public:
  Session(std::unique_ptr<Transport> transport, const NetConfig& config, Admission& admission,
          std::weak_ptr<SessionHost> host);

  /// Waits for the handshake and Hello.
  void start();

  /// Answers and events. `first`: before all that waits.
  void send(const v1::ServerMessage& message, bool first = false);
  void reply_error(std::uint64_t id, int error_code, const std::string& sentence);
  /// A frame of this client's kind.
  void send_frame(std::shared_ptr<const EncodedFrame> frame);
  /// A frame that was due cannot be sent.
  void count_dropped() noexcept { outbox_.count_dropped(1); }
  /// One more frame came out of the pipeline, after `missed` unfetched ones. Returns the kind that
  /// this client gets of it, if any, including what it replaces: parts of the previous frame that
  /// still wait to be sent.
  [[nodiscard]] std::optional<FrameKind> due(std::int64_t timestamp_ns, std::uint64_t missed);
  /// Replaces the subscription, and the frame that waits by the old one.
  void subscribe(const Subscription& subscription);
  /// Closes the connection now and notifies the host.
  void close(const std::string& reason, LogLevel level = LogLevel::info);

  [[nodiscard]] const Subscription& subscription() const noexcept { return subscription_; }
  [[nodiscard]] bool ready() const noexcept { return state_ == State::ready; }
  /// It said Hello, with a right token where one is needed, and there was room.
  [[nodiscard]] bool authenticated() const noexcept { return grant_.has_value(); }
  /// It is not authenticated, and may never be.
  [[nodiscard]] bool unauthenticated() const noexcept { return !grant_ && state_ != State::closed; }
  /// Rights::view until it is authenticated.
  [[nodiscard]] Rights rights() const noexcept { return grant_ ? grant_->rights : Rights::view; }
  /// What the token file calls its token; empty where it needed none or it has no name.
  [[nodiscard]] std::string token_name() const { return grant_ ? grant_->name : std::string(); }
  /// "192.168.1.7:40312 (dtactctl 0.1.0, token arm)"
  [[nodiscard]] std::string identity() const;
  /// Ends the connection of an authenticated client whose token was revoked or has other rights
  /// now.
  void end_if_revoked();
  [[nodiscard]] const Peer& peer() const noexcept { return transport_->peer(); }
  [[nodiscard]] const std::string& program() const noexcept { return program_; }
  /// The outbox in the client's protocol version.
  [[nodiscard]] const Outbox& outbox() const noexcept { return outbox_; }

 private:
  enum class State : std::uint8_t {
    fresh,   ///< Hello has not come.
    denied,  ///< It came without a right; the answer waits, what comes is thrown away.
    ready,   ///< Requests and frames flow.
    ending,  ///< What is queued is sent, what comes is thrown away, then the connection ends.
    closed
  };

  void arm_timer(std::chrono::milliseconds after, const char* reason);
  void read();
  void take(std::string_view input);
  /// Reports to `admission_` how much of large messages is held for this client.
  void note_held();
  void on_message();
  void on_hello(std::uint64_t id, const v1::Hello& hello);
  /// Answers after a while, so that guessing takes its time, and ends.
  void deny(std::uint64_t id, const Admission::Verdict& verdict);
  void log_refusal(const std::string& sentence);
  /// Logs an error and sends it as the last answer.
  void end_with(std::uint64_t id, int error_code, const std::string& sentence);
  /// Sends an error as the last answer and ends.
  void end(std::uint64_t id, int error_code, const std::string& sentence);
  /// The subject of log lines about this client.
  [[nodiscard]] LogSubject subject() const noexcept;
  std::shared_ptr<void> hold() override { return shared_from_this(); }
  void on_write_failed(const std::string& reason) override { close(reason); }
  void on_waiting_changed() override { note_held(); }

  std::unique_ptr<Transport> transport_;
  Outbox outbox_;
  boost::asio::steady_timer timer_;
  const NetConfig& config_;
  Admission& admission_;
  std::weak_ptr<SessionHost> host_;
  std::string program_;
  State state_ = State::fresh;
  Subscription subscription_;
  Subscription::Parts waiting_ = 0;  ///< What the frame holds, or owes, that waits to be sent.
  bool skipping_stalled_reader_ =
      false;  ///< The last frame was not made, since the reader has stopped.

  std::optional<Tokens::Grant> grant_;  ///< Set once authenticated.
  TokenBucket requests_;
  std::vector<char> input_;
  wire::MessageDecoder decoder_{wire::kMaxBeforeHello};
  std::size_t arriving_ = 0;  ///< Bytes of a large message that has come in part.
};

}  // namespace dtact::net
