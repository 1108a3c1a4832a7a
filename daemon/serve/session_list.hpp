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
  /// Connections that have not said Hello at one time. They are unauthenticated clients: whoever
  /// comes after that takes the place of the oldest from where most of them are, so that a flood
  /// from one address leaves room for those from others.
  static constexpr std::size_t kMaxUnauthenticated = 64;

  /// A new connection: it is started.
  void admit(const std::shared_ptr<Session>& session);
  /// To every client that has been greeted and wants events.
  void broadcast(const v1::ServerMessage& event) const;
  /// Lets go of one that has ended. Null when it is not there. Not while all() is walked through,
  /// which a session may end in.
  std::shared_ptr<Session> release(const Session* gone);
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
