#pragma once

#include <string>

#include "clients/cpp/options.hpp"
#include "clients/web/server.hpp"

namespace dtact::web {

/// Reads "NAME=ADDRESS[,fingerprint=SHA256][,ca-file=FILE][,token-file=FILE][,insecure]"; what it
/// does not say is as in `common`, but for how the daemon and this program prove who they are.
/// Throws std::runtime_error naming the part that makes no sense, or what client::read_token()
/// does.
[[nodiscard]] NamedDaemon parse_daemon(const std::string& text, const client::Options& common);

}  // namespace dtact::web
