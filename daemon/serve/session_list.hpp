#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "daemon/serve/session.hpp"

namespace dtact::net {

/// The connections there are.
class SessionList {
 public:
  /// Limit of unauthenticated clients (connections without Hello). Beyond it a new one
  /// replaces the oldest from the host with most of them. So a flood from one address
  /// leaves room for clients from others.
  static constexpr std::size_t kMaxUnauthenticated = 64;

  /// A new connection: it is started.
  void admit(const std::shared_ptr<Session>& session);
  /// To every authenticated client that wants events.
  void broadcast(const v1::ServerMessage& event) const;
  /// Removes a session that has ended. Null when it is not in the list. Not while iterating over
  /// all(), in which a session may end.
  std::shared_ptr<Session> release(const Session* gone);
  /// Ends the connections whose token was revoked or has other rights now.
  void end_revoked() const;
  /// Ends every connection.
  void dismiss(const std::string& reason);
  /// Oldest first.
  [[nodiscard]] const std::vector<std::shared_ptr<Session>>& all() const noexcept {
    return sessions_;
  }

 private:
  std::vector<std::shared_ptr<Session>> sessions_;
};

}  // namespace dtact::net
