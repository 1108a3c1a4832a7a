#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "clients/common/reports.pb.h"
#include "clients/ctl/latency.hpp"

namespace dtact::ctl {

/// What `watch` knows of the frames of an interval, or of all.
class WatchMeter {
 public:
  /// `now_ns`: CLOCK_MONOTONIC when the client had the frame. `same_clock`: it is the daemon's
  /// clock too, so that the delay since capture has a meaning. `counts`: the frame holds what was
  /// asked for (depth).
  void add(const v1::Frame& frame, std::int64_t now_ns, bool same_clock, bool counts);
  void reset();

  [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }
  /// Frames that count, and their rate from the first to the last of them, a second.
  [[nodiscard]] std::uint64_t counted() const noexcept { return counted_; }
  [[nodiscard]] double fps() const noexcept { return rate_until(last_ns_); }
  /// The same from the first of them to `end_ns`: a stream that broke off counts as slow.
  [[nodiscard]] double rate_until(std::int64_t end_ns) const noexcept;
  [[nodiscard]] const LatencyHistogram& latency() const noexcept { return latency_; }
  [[nodiscard]] double deepest_mm() const noexcept { return deepest_mm_; }
  /// All health flags of the frames.
  [[nodiscard]] const std::set<v1::Health>& health() const noexcept { return health_; }

 private:
  std::uint64_t frames_ = 0;
  std::uint64_t counted_ = 0;
  std::int64_t first_ns_ = 0;
  std::int64_t last_ns_ = 0;
  double deepest_mm_ = 0;
  LatencyHistogram latency_;
  std::set<v1::Health> health_;
};

/// One line for people: rate, contact, delay ("-" where the clocks differ), drops, health.
[[nodiscard]] std::string watch_line(const WatchMeter& meter, const v1::Frame& last);
/// The same for --json.
[[nodiscard]] cli::WatchReport watch_report(const WatchMeter& meter, const v1::Frame& last);

}  // namespace dtact::ctl
