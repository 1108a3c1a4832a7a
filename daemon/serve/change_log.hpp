#pragma once

#include <string>

#include "daemon/serve/net_config.hpp"

namespace dtact::v1 {
class ClientMessage;
}

namespace dtact::net {

class Session;

/// The log line of a request that changes something, without its result.
struct ChangeRecord {
  /// "192.168.1.7:40312 (dtactctl 0.1.0, token arm): set_light brightness 128"; empty for a request
  /// that changes nothing.
  std::string text;
  std::string client = {};  ///< As in LogLine.
  std::string token = {};   ///< As in LogLine.
};

/// Names the client, the one that it relays the request of, the request and its values, which need
/// not be valid.
[[nodiscard]] ChangeRecord describe_change(const Session& session,
                                           const v1::ClientMessage& message);

/// Logs the change with its result, "done" or the sentence that says why not. Refusals for lack of
/// rights are of a subject of their own, so that they cannot displace changes.
void log_change(const Log& log, const ChangeRecord& change, const std::string& result,
                LogSubject subject = LogSubject::change);

}  // namespace dtact::net
