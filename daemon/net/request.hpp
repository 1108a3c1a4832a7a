#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <utility>

#include "daemon/pipeline/port.hpp"
#include "daemon/serve/session.hpp"

namespace dtact::v1 {
class Reply;
}

namespace dtact::net {

inline constexpr const char* kBusy = "too many commands wait: ask again in a moment";

/// Where the answer to a request goes: the client's session, and the request's id.
using Requester = std::pair<std::shared_ptr<Session>, std::uint64_t>;
/// The same for what may outlive the session, as every pipeline::Command may.
using WeakWho = std::pair<std::weak_ptr<Session>, std::uint64_t>;

/// Passes a command to the pipeline; `then` is called with its outcome. False, with the answer
/// sent, when the pipeline cannot take another one.
[[nodiscard]] bool submit(pipeline::Port& port, const Requester& requester,
                          decltype(pipeline::Command::what) what,
                          std::function<void(const pipeline::CommandDone&)> then);

/// Answers a request, whose client may be gone, with the outcome of its command: an error, or what
/// `fill` writes into the reply.
void reply(const WeakWho& requester, const pipeline::CommandDone& done,
           const std::function<void(v1::Reply&)>& fill);

}  // namespace dtact::net
