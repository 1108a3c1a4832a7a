#pragma once

#include <cstdint>
#include <span>

namespace dtact::ctl {

/// One question for the other machine's clock and its answer, CLOCK_MONOTONIC of either side.
struct ClockPing {
  std::int64_t sent_ns = 0;      ///< Ours.
  std::int64_t received_ns = 0;  ///< Ours.
  std::int64_t theirs_ns = 0;    ///< While they answered.
};

/// How far another clock is ahead of ours, at a moment of ours.
struct ClockOffset {
  std::int64_t at_ns = 0;
  std::int64_t offset_ns = 0;
  /// However unevenly the way there and back shared the round trip, the offset is no farther off.
  std::int64_t uncertainty_ns = 0;
};

/// From the ping with the shortest round trip, as NTP's clock filter does (RFC 5905, section 10):
/// what makes others longer are queues, which lie on one of the two ways. There has to be one.
[[nodiscard]] ClockOffset shortest_round_trip(std::span<const ClockPing> pings);

/// The offset at `at_ns` of ours on the line through two estimates: clocks drift apart by some ten
/// microseconds a second.
[[nodiscard]] std::int64_t offset_at(const ClockOffset& before, const ClockOffset& after,
                                     std::int64_t at_ns);

}  // namespace dtact::ctl
