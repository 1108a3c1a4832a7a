#include "clients/ctl/clock_offset.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::ctl {

ClockOffset shortest_round_trip(std::span<const ClockPing> pings) {
  const auto round_trip = [](const ClockPing& ping) { return ping.received_ns - ping.sent_ns; };
  const ClockPing& best = *std::ranges::min_element(pings, {}, round_trip);
  const std::int64_t middle = best.sent_ns + round_trip(best) / 2;
  return {middle, best.theirs_ns - middle, (round_trip(best) + 1) / 2};
}

std::int64_t offset_at(const ClockOffset& before, const ClockOffset& after, std::int64_t at_ns) {
  if (after.at_ns == before.at_ns) return before.offset_ns;
  const double share =
      static_cast<double>(at_ns - before.at_ns) / static_cast<double>(after.at_ns - before.at_ns);
  return before.offset_ns +
         std::llround(share * static_cast<double>(after.offset_ns - before.offset_ns));
}

}  // namespace dtact::ctl
