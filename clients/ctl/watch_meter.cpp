#include "clients/ctl/watch_meter.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "clients/ctl/json/json.hpp"

namespace dtact::ctl {

void WatchMeter::add(const client::Frame& frame, std::int64_t now_ns, bool same_clock,
                     bool counts) {
  ++frames_;
  if (counts) {
    if (counted_++ == 0) first_ns_ = now_ns;
    last_ns_ = now_ns;
  }
  if (same_clock) latency_.add(now_ns - frame.monotonic_ns);
  deepest_mm_ = std::max(deepest_mm_, frame.contact.deepest_mm);
  health_.insert(frame.health.begin(), frame.health.end());
}

void WatchMeter::reset() { *this = WatchMeter(); }

double WatchMeter::rate_until(std::int64_t end_ns) const noexcept {
  if (counted_ < 2 || end_ns <= first_ns_) return 0;
  return static_cast<double>(counted_ - 1) * 1e9 / static_cast<double>(end_ns - first_ns_);
}

std::string watch_line(const WatchMeter& meter, const client::Frame& last) {
  const auto& latency = meter.latency();
  const std::string delay =
      latency.count() == 0 ? "-"
                           : fmt::format("p50 {:.1f} p99 {:.1f} ms", latency.percentile_ms(0.5),
                                         latency.percentile_ms(0.99));
  const std::string worth =
      last.depth ? fmt::format(" +- {:.3f}", last.depth->uncertainty_um / 1000) : "";
  return fmt::format(
      "{:5.1f} fps  contact {:6.1f} mm2  deepest {:6.3f} mm{}  latency {}  drops {}  {}",
      meter.fps(), last.contact.area_mm2, last.contact.deepest_mm, worth, delay, last.dropped,
      last.health.empty() ? "ok" : fmt::format("{}", fmt::join(last.health, ",")));
}

std::string watch_json(const WatchMeter& meter, const client::Frame& last) {
  Json json;
  json.open('{').member("sequence", last.sequence).member("fps", meter.fps());
  json.member("touching", last.contact.touching).member("area_mm2", last.contact.area_mm2);
  json.member("deepest_mm", last.contact.deepest_mm);
  if (last.depth) {
    json.member("uncertainty_um", last.depth->uncertainty_um);
    json.member("decimation", last.depth->decimation);
  }
  const auto& latency = meter.latency();
  if (latency.count() == 0) {
    json.key("latency_p50_ms").null().key("latency_p99_ms").null();
  } else {
    json.member("latency_p50_ms", latency.percentile_ms(0.5));
    json.member("latency_p99_ms", latency.percentile_ms(0.99));
  }
  json.member("dropped", last.dropped).member("health", last.health).close('}');
  return json.text();
}

}  // namespace dtact::ctl
