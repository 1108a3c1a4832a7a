#include "daemon/metrics/text.hpp"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <algorithm>
#include <cstddef>
#include <utility>

namespace dtact::metrics {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

/// The families of metrics, one begun after another.
class Families {
 public:
  /// What follows belongs to it.
  Families& begin(const char* name, const char* help, MetricType type) {
    all_.push_back({name, help, type, {}});
    return *this;
  }
  void add(double value, Labels labels = {}) {
    ClientMetric metric;
    metric.label = std::move(labels);
    (all_.back().type == MetricType::Counter ? metric.counter.value : metric.gauge.value) = value;
    all_.back().metric.push_back(std::move(metric));
  }
  void add(const pipeline::StageStatistics& stage) {
    ClientMetric metric;
    metric.label = {{"stage", stage.stage}};
    metric.histogram.sample_count = stage.count;
    metric.histogram.sample_sum = stage.sum_us * 1e-6;
    for (std::size_t i = 0; i < stage.within.size(); ++i) {
      const auto bound_ns = static_cast<double>(pipeline::kStageBoundsNs[i]);
      metric.histogram.bucket.push_back({stage.within[i], bound_ns / 1e9});
    }
    all_.back().metric.push_back(std::move(metric));
  }

  void gauge(const char* name, const char* help, double value) {
    begin(name, help, MetricType::Gauge).add(value);
  }
  void counter(const char* name, const char* help, std::uint64_t value) {
    begin(name, help, MetricType::Counter).add(static_cast<double>(value));
  }
  /// 1 with these labels: something that is no number.
  void info(const char* name, const char* help, Labels labels) {
    begin(name, help, MetricType::Gauge).add(1, std::move(labels));
  }

  [[nodiscard]] std::string text() const { return prometheus::TextSerializer().Serialize(all_); }

 private:
  std::vector<prometheus::MetricFamily> all_;
};

/// HEALTH_LIGHT_DRIFTED → "light_drifted".
std::string short_name(std::string name) {
  name.erase(0, name.find('_') + 1);
  std::ranges::transform(name, name.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return name;
}

bool has(const v1::Status& status, v1::Health flag) {
  return std::ranges::find(status.health(), flag) != status.health().end();
}

void add_state(Families& to, const v1::Status& status) {
  to.info("dtactd_build_info", "The daemon's version.", {{"version", status.version()}});
  to.gauge("dtactd_uptime_seconds", "Time since the daemon started.", status.uptime_s());
  to.begin("dtactd_state", "1 for the state that the daemon is in.", MetricType::Gauge);
  for (int state = v1::STATE_UNSPECIFIED + 1; v1::State_IsValid(state); ++state) {
    to.add(status.state() == state ? 1 : 0,
           {{"state", short_name(v1::State_Name(static_cast<v1::State>(state)))}});
  }
  to.begin("dtactd_health_flag", "1 while this health flag is set: depth deserves less trust.",
           MetricType::Gauge);
  for (int one = v1::HEALTH_NONE + 1; v1::Health_IsValid(one); ++one) {
    const auto flag = static_cast<v1::Health>(one);
    to.add(has(status, flag) ? 1 : 0, {{"flag", short_name(v1::Health_Name(flag))}});
  }
}

void add_frames(Families& to, const net::Overview& overview) {
  const v1::Status& status = overview.status;
  const v1::CameraStatus& camera = status.camera();
  to.counter("dtactd_frames_total", "Frames published by the capture loop.", status.frames());
  to.gauge("dtactd_frames_per_second",
           "Frames that passed the capture loop within the last second, subscribed or not.",
           status.fps());
  to.begin(
      "dtactd_frames_dropped_total",
      "Frames lost on the way, by cause: lost before the camera's driver had them; skipped for a "
      "newer one; damaged (flagged by the driver, without JPEG markers, too_short, "
      "undecodable); replaced before they were encoded; missed by slow clients.",
      MetricType::Counter);
  const std::pair<const char*, std::uint64_t> drops[] = {
      {"lost", camera.lost()},
      {"skipped", camera.skipped()},
      {"damaged_flagged", camera.damage().flagged()},
      {"damaged_markers", camera.damage().markers()},
      {"damaged_too_short", camera.damage().too_short()},
      {"damaged_undecodable", camera.damage().undecodable()},
      {"replaced", status.skipped()},
      {"slow_client", overview.traffic.dropped}};
  for (const auto& [cause, count] : drops) to.add(static_cast<double>(count), {{"cause", cause}});
  to.begin("dtactd_stage_duration_seconds",
           "What each stage takes of a frame's time; total: from ready to published; handover: "
           "until the network thread has it.",
           MetricType::Histogram);
  for (const auto& stage : overview.stages) to.add(stage);
}

void add_camera(Families& to, const v1::CameraStatus& camera) {
  to.info("dtactd_camera_info", "Which camera, and how it runs.",
          {{"backend", camera.backend()},
           {"identity", camera.identity()},
           {"pixel_format", camera.pixel_format()}});
  to.begin("dtactd_camera_state", "1 for the state that the camera is in.", MetricType::Gauge);
  for (const char* flag : {"streaming", "stalled", "unplugged", "busy", "denied", "ended"}) {
    to.add(camera.state() == flag ? 1 : 0, {{"state", flag}});
  }
  to.gauge("dtactd_camera_mode_frames_per_second", "What the camera's mode promises.",
           camera.fps());
  to.counter("dtactd_camera_frames_delivered_total", "Whole frames that the camera handed out.",
             camera.delivered());
  to.counter("dtactd_camera_disconnects_total", "Times the camera went away.",
             camera.disconnects());
}

void add_light(Families& to, const net::Overview& overview, std::int64_t now_ns) {
  const v1::Status& status = overview.status;
  to.info("dtactd_ring_info", "Which LED ring.",
          {{"backend", status.ring().backend()}, {"identity", status.ring().identity()}});
  to.gauge("dtactd_ring_up", "0 while the ring is away or refused the last write.",
           has(status, v1::HEALTH_RING_FAULT) ? 0 : 1);
  to.gauge("dtactd_light_brightness_ratio", "The ring's brightness, 0 to 1.",
           status.light().brightness() / 255.0);
  to.gauge("dtactd_light_followed_ratio",
           "How far the reference follows the light since it was taken; negative: dimmer.",
           status.light_followed());
  if (overview.reference_taken_ns.has_value()) {
    to.gauge("dtactd_reference_age_seconds",
             "Since the reference image was taken; absent for one of an earlier run.",
             static_cast<double>(now_ns - *overview.reference_taken_ns) * 1e-9);
  }
  if (status.has_calibration()) {
    to.info("dtactd_calibration_info", "The calibration in use; absent without one.",
            {{"name", status.calibration().name()}, {"method", status.calibration().method()}});
  }
}

void add_clients(Families& to, const net::Overview& overview) {
  for (const auto& endpoint : overview.status.endpoints()) {
    if (!endpoint.has_certificate_days()) continue;
    to.gauge("dtactd_certificate_days",
             "Days until the TLS certificate expires; negative: it has. Absent without TLS.",
             endpoint.certificate_days());
  }
  const net::Traffic& traffic = overview.traffic;
  to.gauge("dtactd_clients", "Authenticated clients.", overview.status.clients_size());
  to.counter("dtactd_connections_total", "Connections accepted.", traffic.connections);
  to.counter("dtactd_connections_refused_total",
             "Of those, ended before they were authenticated: too many, no or a wrong token, no "
             "Hello, no TLS.",
             traffic.refused);
  to.counter("dtactd_frames_encoded_total",
             "Frame messages encoded: one a frame and kind of subscription, however many clients.",
             overview.status.encoded());
  to.counter("dtactd_frames_sent_total", "Frame messages sent to clients.", traffic.frames);
  to.counter("dtactd_sent_bytes_total", "Bytes sent to clients: frames, answers and events.",
             traffic.bytes);
}

void add_machine(Families& to, const net::Overview& overview, const base::Heap& heap) {
  const v1::Status& status = overview.status;
  const v1::ThreadUsage& usage = status.capture_thread();
  to.begin("dtactd_capture_thread_page_faults_total",
           "The capture thread's page faults: major ones read a disk.", MetricType::Counter);
  to.add(static_cast<double>(usage.minor_faults()), {{"kind", "minor"}});
  to.add(static_cast<double>(usage.major_faults()), {{"kind", "major"}});
  to.begin("dtactd_capture_thread_context_switches_total",
           "The capture thread's context switches: because it waited, or preempted by another "
           "thread.",
           MetricType::Counter);
  to.add(static_cast<double>(usage.waits()), {{"kind", "waiting"}});
  to.add(static_cast<double>(usage.preemptions()), {{"kind", "preempted"}});
  to.gauge("dtactd_realtime_settings_refused", "Real-time settings that the system refused.",
           status.realtime_refused_size());
  to.begin("dtactd_heap_bytes",
           "Memory of the allocator: in use, of which mapped are the large blocks, and kept for "
           "later.",
           MetricType::Gauge);
  to.add(static_cast<double>(heap.used - heap.mapped), {{"kind", "used"}});
  to.add(static_cast<double>(heap.mapped), {{"kind", "mapped"}});
  to.add(static_cast<double>(heap.free), {{"kind", "kept"}});
  if (overview.temperatures.empty()) return;
  to.begin("dtactd_board_temperature_celsius", "The board's own thermal zones.", MetricType::Gauge);
  for (const auto& one : overview.temperatures) {
    to.add(one.celsius, {{"zone", one.zone}, {"type", one.type}});
  }
}

}  // namespace

std::string text(const net::Overview& overview, const base::Heap& heap, std::int64_t now_ns) {
  Families families;
  add_state(families, overview.status);
  add_frames(families, overview);
  add_camera(families, overview.status.camera());
  add_light(families, overview, now_ns);
  add_clients(families, overview);
  add_machine(families, overview, heap);
  return families.text();
}

}  // namespace dtact::metrics
