#pragma once

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "daemon/serve/net_config.hpp"
#include "daemon/serve/token_bucket.hpp"

namespace dtact::net {

/// `log` with at most 100 lines at once and 10 a second, so that strangers cannot fill the journal.
/// The next line says how many were left out.
[[nodiscard]] inline Log limited(Log log) {
  struct State {
    Log log;
    TokenBucket lines{10, 100};
    unsigned long left_out = 0;
  };
  return [state = std::make_shared<State>(State{std::move(log)})](LogLine line) {
    if (!state->lines.take(1)) {
      ++state->left_out;
      return;
    }
    const auto left_out = std::exchange(state->left_out, 0);
    if (left_out > 0) line.text += fmt::format(" ({} lines left out before)", left_out);
    state->log(line);
  };
}

}  // namespace dtact::net
