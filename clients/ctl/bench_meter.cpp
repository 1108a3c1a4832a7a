#include "clients/ctl/bench_meter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "clients/ctl/latency.hpp"
#include "proto/framing.hpp"

namespace dtact::ctl {
namespace {

/// The bytes of a frame on the wire: its length, ServerMessage's field, itself.
std::uint64_t size_on_wire(const v1::Frame& frame) {
  const std::size_t size = frame.ByteSizeLong();
  std::size_t varint = 1;
  for (std::size_t rest = size >> 7U; rest != 0; rest >>= 7U) ++varint;
  return wire::kLengthSize + 1 + varint + size;
}

v1::Frame without_maps(const v1::Frame& frame) {
  v1::Frame head;
  head.set_dropped(frame.dropped());
  head.set_meaning(frame.meaning());
  return head;
}

}  // namespace

void BenchMeter::add(const v1::Frame& frame, std::int64_t now_ns) {
  last_ = without_maps(frame);
  if (arrivals_.empty()) {
    first_ = last_;
  } else {
    bytes_ += size_on_wire(frame);
  }
  arrivals_.push_back({frame.monotonic_ns(), now_ns});
}

cli::BenchReport BenchMeter::report(
    const std::function<std::int64_t(std::int64_t)>& offset_at) const {
  cli::BenchReport report;
  report.set_frames(arrivals_.size());
  if (arrivals_.empty()) return report;
  report.set_since(last_.meaning());

  LatencyHistogram latencies;
  LatencyHistogram jitters;
  std::int64_t worst_latency_ns = 0;
  std::int64_t worst_jitter_ns = 0;
  const Arrival* before = nullptr;
  for (const Arrival& one : arrivals_) {
    if (offset_at) {
      const std::int64_t delay_ns = one.arrived_ns + offset_at(one.arrived_ns) - one.captured_ns;
      latencies.add(delay_ns);
      worst_latency_ns = std::max(worst_latency_ns, delay_ns);
    }
    if (before != nullptr) {
      const std::int64_t jitter_ns =
          std::abs((one.arrived_ns - before->arrived_ns) - (one.captured_ns - before->captured_ns));
      jitters.add(jitter_ns);
      worst_jitter_ns = std::max(worst_jitter_ns, jitter_ns);
    }
    before = &one;
  }
  if (offset_at) {
    report.set_latency_p50_ms(latencies.percentile_ms(0.5));
    report.set_latency_p99_ms(latencies.percentile_ms(0.99));
    report.set_latency_max_ms(static_cast<double>(worst_latency_ns) * 1e-6);
  }
  report.set_jitter_p50_ms(jitters.percentile_ms(0.5));
  report.set_jitter_p99_ms(jitters.percentile_ms(0.99));
  report.set_jitter_max_ms(static_cast<double>(worst_jitter_ns) * 1e-6);

  const double seconds =
      static_cast<double>(arrivals_.back().arrived_ns - arrivals_.front().arrived_ns) * 1e-9;
  report.set_seconds(seconds);
  if (seconds > 0) {
    report.set_fps(static_cast<double>(arrivals_.size() - 1) / seconds);
    report.set_bytes_per_second(static_cast<double>(bytes_) / seconds);
  }
  report.set_missed(last_.dropped() - first_.dropped());
  return report;
}

std::string bench_head() {
  return fmt::format(
      "{:<14} {:>6} {:>9} {:>8}   {:>20}   {:>20}\n{:<14} {:>6} {:>9} "
      "{:>8}   {:>6} {:>6} {:>6}   {:>6} {:>6} {:>6} {:>7} {:>7} {:>6}\n",
      "", "", "bytes", "", "latency, ms", "jitter, ms", "encoding", "fps", "a frame", "Mbit/s",
      "p50", "p99", "max", "p50", "p99", "max", "missed", "skipped", "lost");
}

std::string bench_line(const cli::BenchReport& report) {
  std::string name = v1::DepthEncoding_Name(report.encoding());
  name = name.substr(name.find('_') + 1);
  std::ranges::transform(name, name.begin(), [](char c) { return c == '_' ? c : c | 0x20; });
  if (!report.refused().empty()) return fmt::format("{:<14} {}\n", name, report.refused());
  const auto latency = [&](double ms) {
    return report.has_latency_p50_ms() ? fmt::format("{:6.2f}", ms) : "     -";
  };
  return fmt::format(
      "{:<14} {:6.1f} {:9.0f} {:8.2f}   {} {} {}   {:6.2f} {:6.2f} {:6.2f} {:7} {:7} {:6}\n", name,
      report.fps(), report.fps() > 0 ? report.bytes_per_second() / report.fps() : 0.0,
      report.bytes_per_second() * 8e-6, latency(report.latency_p50_ms()),
      latency(report.latency_p99_ms()), latency(report.latency_max_ms()), report.jitter_p50_ms(),
      report.jitter_p99_ms(), report.jitter_max_ms(), report.missed(), report.skipped(),
      report.lost());
}

}  // namespace dtact::ctl
