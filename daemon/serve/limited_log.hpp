#pragma once

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "daemon/serve/net_config.hpp"
#include "daemon/serve/token_bucket.hpp"

namespace dtact::net {

/// `log` with at most 100 lines at once and 10 a second, so that unauthenticated clients cannot
/// fill the journal. The next line says how many were left out.
[[nodiscard]] inline Log limited(Log log) {
  struct State {
    Log log;
    TokenBucket lines{10, 100};
    unsigned long suppressed = 0;
  };
  return [state = std::make_shared<State>(State{std::move(log)})](LogLine line) {
    if (!state->lines.take(1)) {
      ++state->suppressed;
      return;
    }
    const auto suppressed = std::exchange(state->suppressed, 0);
    if (suppressed > 0) line.text += fmt::format(" ({} lines left out before)", suppressed);
    state->log(line);
  };
}

}  // namespace dtact::net
