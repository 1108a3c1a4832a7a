#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "daemon/pipeline/port.hpp"
#include "daemon/serve/change_log.hpp"
#include "daemon/serve/session.hpp"

namespace dtact::v1 {
class ClientMessage;
class Reply;
}  // namespace dtact::v1

namespace dtact::net {

inline constexpr const char* kBusy = "too many commands wait: ask again in a moment";

/// A client's request, which is owed one answer. The client may be gone by then: a
/// pipeline::Command may outlive its session. A request that changes something has its line in the
/// log all the same, written with the answer.
class Requester {
 public:
  /// `log` must outlive what answers.
  Requester(const std::shared_ptr<Session>& session, const v1::ClientMessage& message,
            const Log& log);

  /// Null when the client is gone.
  [[nodiscard]] std::shared_ptr<Session> session() const { return session_.lock(); }
  /// Answers with what `fill` writes into the reply. `first`: before all that waits. `result` is
  /// the log's.
  void reply(const std::function<void(v1::Reply&)>& fill, bool first = false,
             const std::string& result = "done") const;
  void refuse(int error_code, const std::string& sentence) const;
  /// Answers with the outcome of a command: an error, or what `fill` writes into the reply.
  void reply(const pipeline::CommandDone& done, const std::function<void(v1::Reply&)>& fill) const;

 private:
  std::weak_ptr<Session> session_;
  std::uint64_t id_;
  ChangeRecord change_;
  const Log* log_;
};

/// Passes a command to the pipeline; `then` is called with its outcome. False, with the answer
/// sent, when the pipeline cannot take another one.
[[nodiscard]] bool submit(pipeline::Port& port, const Requester& requester,
                          decltype(pipeline::Command::what) what,
                          std::function<void(const pipeline::CommandDone&)> then);

}  // namespace dtact::net
