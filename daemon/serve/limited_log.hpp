#pragma once

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <memory>
#include <utility>

#include "daemon/serve/net_config.hpp"
#include "daemon/serve/token_bucket.hpp"
#include "hal/base/utf8.hpp"

namespace dtact::net {

/// Bytes of a line that are logged.
inline constexpr std::size_t kMaxLogLine = 2000;

/// `log` with a rate limit for each subject, so that no client can fill the journal, and
/// unauthenticated ones cannot displace lines about others. The next line about the same
/// subject says how many were left out. A line is one line, whatever words of a client it repeats.
[[nodiscard]] inline Log limited(Log log) {
  struct Limit {
    TokenBucket lines;
    unsigned long suppressed = 0;
  };
  struct State {
    Log log;
    // A program that dims the light with each frame has all of its commands in the log.
    std::array<Limit, kLogSubjects> limits{{{TokenBucket(10, 100)},
                                            {TokenBucket(10, 100)},
                                            {TokenBucket(100, 1000)},
                                            {TokenBucket(10, 100)}}};
  };
  return [state = std::make_shared<State>(State{std::move(log)})](LogLine line) {
    Limit& limit = state->limits.at(static_cast<std::size_t>(line.subject));
    if (!limit.lines.take(1)) {
      ++limit.suppressed;
      return;
    }
    line.text = base::printable(base::first_bytes(line.text, kMaxLogLine));
    const auto suppressed = std::exchange(limit.suppressed, 0);
    if (suppressed > 0) line.text += fmt::format(" ({} lines left out before)", suppressed);
    state->log(line);
  };
}

}  // namespace dtact::net
