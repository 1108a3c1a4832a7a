#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "daemon/serve/net_config.hpp"
#include "daemon/serve/rights.hpp"
#include "daemon/serve/token_bucket.hpp"
#include "daemon/serve/tokens.hpp"
#include "daemon/serve/transport.hpp"

namespace dtact::net {

/// Those of config.token_file; nothing when none is configured. Throws as Tokens and
/// read_private_file().
[[nodiscard]] std::optional<Tokens> read_tokens(const NetConfig& config);

/// Decides which clients are authenticated and with which rights, and limits what all clients
/// together take. On the network thread.
class Admission {
 public:
  /// Bytes of large messages that have arrived in part, and of large answers that are unread, of
  /// all clients together: two of the longest.
  static constexpr std::size_t kMaxHeld = std::size_t{32} << 20U;
  /// Delay of the answer to an address's first wrong token. It doubles with each further one.
  static constexpr std::chrono::milliseconds kDenial{500};
  static constexpr std::chrono::milliseconds kMaxDenial{16'000};
  /// After this time without a wrong token the next one counts as the first.
  static constexpr std::chrono::minutes kForgetWrong{10};
  /// Places above NetConfig::max_clients for those with Peer.trusted, so that root reaches a full
  /// daemon.
  static constexpr std::size_t kReserved = 4;
  /// TLS handshakes per second that one address gets, and as many at once after a rest. An
  /// unauthenticated client may ask for them, and each takes some 0.4 ms of the thread that sends
  /// the frames.
  static constexpr double kHandshakesPerS = 100;

  /// Throws as read_tokens().
  explicit Admission(const NetConfig& config);

  /// Authenticated clients keep their rights until the owner of the connection asks
  /// still_allows().
  void set_tokens(std::optional<Tokens> tokens) noexcept { tokens_ = std::move(tokens); }

  struct Verdict {
    std::optional<Tokens::Grant> grant;  ///< Empty: refused, …
    int error_code = 0;                  ///< … as ERROR_DENIED or ERROR_BUSY, …
    std::string sentence;                ///< … because of this.
    /// ERROR_DENIED is to be answered after this, so that guessing takes its time: twice as long
    /// after each wrong token of the same Peer.host. Right ones are never delayed.
    std::chrono::milliseconds delay{0};
  };
  /// What enter() would say. Counts a wrong token, but not the client.
  [[nodiscard]] Verdict judge(const Peer& peer, const std::string& token);
  /// After a Hello with this token. An authenticated client counts until leave().
  [[nodiscard]] Verdict enter(const Peer& peer, const std::string& token);
  void leave(const Peer& peer);
  /// Whether this connection gets a TLS handshake now. One that does not is closed.
  [[nodiscard]] bool take_handshake(const Peer& peer);
  /// False: its token was revoked since, or has other rights now.
  [[nodiscard]] bool still_allows(const Tokens::Grant& grant) const {
    return grant.hash.empty() || (tokens_ && tokens_->holds(grant));
  }

  /// `bytes` of large messages from and to `client`, of Peer.host `host`, are held. When all
  /// clients together have more than kMaxHeld, others are disconnected: those with most of the host
  /// that has most. `disconnect` is called then, and ends the connection.
  void hold(const void* client, const std::string& host, std::size_t bytes,
            std::function<void()> disconnect);

 private:
  const NetConfig& config_;
  std::optional<Tokens> tokens_;
  std::size_t clients_ = 0;
  std::map<std::string, std::size_t> hosts_;  ///< Clients by Peer.host.

  using Clock = std::chrono::steady_clock;
  struct Wrong {
    unsigned count = 0;  ///< Wrong tokens, …
    Clock::time_point last;
  };
  /// The address that showed one longest ago is forgotten for another.
  static constexpr std::size_t kMaxWrongHosts = 1024;
  [[nodiscard]] std::chrono::milliseconds delay_after_wrong(const std::string& host);
  std::map<std::string, Wrong> wrong_;  ///< … by Peer.host.

  /// Beyond it all are forgotten: each of 1,024 addresses has a burst of its own anyway.
  static constexpr std::size_t kMaxHandshakeHosts = 1024;
  std::map<std::string, TokenBucket> handshakes_;  ///< By Peer.host.

  struct Held {
    std::string host;
    std::size_t bytes = 0;
    std::function<void()> disconnect;
  };
  using HeldMap = std::map<const void*, Held>;
  /// The client to give up for `asking`; end(): there is no other.
  [[nodiscard]] HeldMap::iterator worst_beside(const void* asking);
  HeldMap held_;  ///< By client, without those of which nothing is held.
  std::size_t held_bytes_ = 0;
};

}  // namespace dtact::net
