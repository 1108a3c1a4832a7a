#include "daemon/serve/session_list.hpp"

#include <algorithm>
#include <map>
#include <string_view>
#include <utility>

#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

/// The oldest unauthenticated client from where most of them are; null unless there are too many.
std::shared_ptr<Session> one_too_many(const std::vector<std::shared_ptr<Session>>& sessions) {
  std::map<std::string_view, std::size_t> hosts;
  std::size_t unauthenticated_count = 0;
  for (const auto& session : sessions) {
    if (!session->unauthenticated()) continue;
    ++unauthenticated_count;
    ++hosts[session->peer().host];
  }
  if (unauthenticated_count <= SessionList::kMaxUnauthenticated) return nullptr;
  const auto most = std::max_element(
      hosts.begin(), hosts.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return *std::find_if(sessions.begin(), sessions.end(), [&](const auto& session) {
    return session->unauthenticated() && hosts[session->peer().host] == most->second;
  });
}

}  // namespace

void SessionList::admit(const std::shared_ptr<Session>& session) {
  sessions_.push_back(session);
  if (const auto other = one_too_many(sessions_)) {
    other->close("too many connections wait for Hello", LogLevel::warning);
  }
  session->start();
}

void SessionList::broadcast(const v1::ServerMessage& event) const {
  for (const auto& session : sessions_) {
    if (session->ready() && session->subscription().events()) session->send(event);
  }
}

void SessionList::end_revoked() const {
  for (const auto& session : sessions_) session->end_if_revoked();
}

std::shared_ptr<Session> SessionList::release(const Session* gone) {
  const auto found =
      std::ranges::find_if(sessions_, [gone](const auto& other) { return other.get() == gone; });
  if (found == sessions_.end()) return nullptr;
  std::shared_ptr<Session> released = *found;
  sessions_.erase(found);
  return released;
}

void SessionList::dismiss(const std::string& reason) {
  const auto sessions = std::exchange(sessions_, {});
  for (const auto& session : sessions) session->close(reason);
}

}  // namespace dtact::net
