#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "daemon/serve/net_config.hpp"
#include "daemon/serve/rights.hpp"
#include "daemon/serve/tokens.hpp"
#include "daemon/serve/transport.hpp"

namespace dtact::net {

/// Those of config.token_file; nothing when none is configured. Throws as Tokens and
/// read_private_file().
[[nodiscard]] std::optional<Tokens> read_tokens(const NetConfig& config);

/// Who is let in, with which rights, and what all clients together may take. On the network thread.
class Admission {
 public:
  /// Bytes of large messages that have arrived in part, of all clients together: two of the
  /// longest.
  static constexpr std::size_t kMaxIncoming = std::size_t{32} << 20U;

  /// Throws as read_tokens().
  explicit Admission(const NetConfig& config);

  /// Counts for clients that come from now on.
  void set_tokens(std::optional<Tokens> tokens) noexcept { tokens_ = std::move(tokens); }

  struct Verdict {
    std::optional<Rights> rights;  ///< Empty: refused, …
    int error_code = 0;            ///< … as ERROR_DENIED or ERROR_BUSY, …
    std::string sentence;          ///< … because of this.
    std::string token_name;        ///< What the token file calls the token.
  };
  /// After a Hello with this token. Who is let in counts until leave().
  [[nodiscard]] Verdict enter(const Peer& peer, const std::string& token);
  void leave(const Peer& peer);

  /// A client's message takes `now` bytes instead of `before`. False when that is too much for all
  /// of them together; it counts all the same.
  [[nodiscard]] bool hold(std::size_t before, std::size_t now) noexcept;

 private:
  const NetConfig& config_;
  std::optional<Tokens> tokens_;
  std::size_t clients_ = 0;
  std::map<std::string, std::size_t> hosts_;  ///< Clients by Peer.host.
  std::size_t incoming_ = 0;
};

}  // namespace dtact::net
