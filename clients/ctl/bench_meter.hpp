#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "clients/common/reports.pb.h"

namespace dtact::ctl {

/// What `bench` saw of a stream: every frame's times and size. What the camera lost and what the
/// daemon skipped is the daemon's to count (Status.camera).
class BenchMeter {
 public:
  /// `now_ns`: CLOCK_MONOTONIC when the client had the frame.
  void add(const v1::Frame& frame, std::int64_t now_ns);

  [[nodiscard]] std::size_t frames() const noexcept { return arrivals_.size(); }
  /// `offset_at`: how far the daemon's CLOCK_MONOTONIC is ahead of ours at a moment of ours; empty
  /// when that is not known, and the report has no latency then.
  [[nodiscard]] cli::BenchReport report(
      const std::function<std::int64_t(std::int64_t)>& offset_at) const;

 private:
  struct Arrival {
    std::int64_t captured_ns = 0;  ///< By the daemon's clock.
    std::int64_t arrived_ns = 0;   ///< By ours.
  };
  std::vector<Arrival> arrivals_;
  std::uint64_t bytes_ = 0;  ///< With all that is around a frame, without the first.
  v1::Frame first_;          ///< Without maps, as the next one.
  v1::Frame last_;
};

/// A line for people, below bench_head().
[[nodiscard]] std::string bench_line(const cli::BenchReport& report);
[[nodiscard]] std::string bench_head();

}  // namespace dtact::ctl
