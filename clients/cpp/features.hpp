#pragma once

#include <string>

#include "proto/dtact.pb.h"

namespace dtact::client {

[[nodiscard]] bool lists_feature(const v1::HelloReply& daemon, const std::string& feature);

/// Throw Refused with ERROR_UNSUPPORTED where the daemon does not list what a request needs, by the
/// names of proto/README.md. One of version 1.0 lists nothing: it would end the connection over a
/// request that it does not know, and pass over a field. Not part of the library's interface.
void require_feature(const v1::HelloReply& daemon, const std::string& feature);
void require_features(const v1::HelloReply& daemon, const v1::Subscribe& subscription);

}  // namespace dtact::client
