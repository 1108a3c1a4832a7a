#include "clients/ctl/watch_meter.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "clients/cpp/names.hpp"

namespace dtact::ctl {

void WatchMeter::add(const v1::Frame& frame, std::int64_t now_ns, bool same_clock, bool counts) {
  ++frames_;
  if (counts) {
    if (counted_++ == 0) first_ns_ = now_ns;
    last_ns_ = now_ns;
  }
  if (same_clock) latency_.add(now_ns - frame.monotonic_ns());
  deepest_mm_ = std::max(deepest_mm_, frame.contact().deepest_mm());
  for (const int flag : frame.health()) health_.insert(static_cast<v1::Health>(flag));
}

void WatchMeter::reset() { *this = WatchMeter(); }

double WatchMeter::rate_until(std::int64_t end_ns) const noexcept {
  if (counted_ < 2 || end_ns <= first_ns_) return 0;
  return static_cast<double>(counted_ - 1) * 1e9 / static_cast<double>(end_ns - first_ns_);
}

std::string watch_line(const WatchMeter& meter, const v1::Frame& last) {
  const auto& latency = meter.latency();
  const std::string delay =
      latency.count() == 0 ? "-"
                           : fmt::format("p50 {:.1f} p99 {:.1f} ms", latency.percentile_ms(0.5),
                                         latency.percentile_ms(0.99));
  std::string worth =
      last.has_depth() ? fmt::format(" +- {:.3f}", last.depth().uncertainty_um() / 1000) : "";
  if (last.depth().sharpen_steps() > 0) {
    worth += fmt::format(" sharpened {}x", last.depth().sharpen_steps());
  }
  std::string force;
  if (last.contact().has_force_n()) {
    force = fmt::format("  force {:.2f} N +- {:.2f}", last.contact().force_n(),
                        last.contact().force_uncertainty_n());
  } else if (last.contact().force_absence() > v1::FORCE_ABSENCE_UNCALIBRATED) {
    force = fmt::format("  force {}", client::name_of(last.contact().force_absence()));
  }
  return fmt::format(
      "{:5.1f} fps  contact {:6.1f} mm2  deepest {:6.3f} mm{}{}  latency {}  drops {}  {}",
      meter.fps(), last.contact().area_mm2(), last.contact().deepest_mm(), worth, force, delay,
      last.dropped(),
      last.health().empty() ? "ok"
                            : fmt::format("{}", fmt::join(client::names_of(last.health()), ",")));
}

cli::WatchReport watch_report(const WatchMeter& meter, const v1::Frame& last) {
  cli::WatchReport report;
  report.set_frames(meter.frames());
  report.set_depth_frames(meter.counted());
  report.set_fps(meter.fps());
  const auto& latency = meter.latency();
  if (latency.count() > 0) {
    report.set_latency_p50_ms(latency.percentile_ms(0.5));
    report.set_latency_p99_ms(latency.percentile_ms(0.99));
  }
  report.set_deepest_mm(meter.deepest_mm());
  for (const v1::Health flag : meter.health()) report.add_health(flag);
  *report.mutable_newest() = last;
  return report;
}

}  // namespace dtact::ctl
