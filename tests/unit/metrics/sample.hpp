#pragma once

#include "daemon/metrics/text.hpp"
#include "daemon/pipeline/statistics.hpp"

namespace dtact::metrics::test {

/// An overview in which everything has a value of its own.
inline net::Overview overview() {
  net::Overview all;
  v1::Status& status = all.status;
  status.set_state(v1::STATE_SERVING);
  status.add_health(v1::HEALTH_NOT_REALTIME);
  status.set_version("9.8.7");
  status.set_uptime_s(12.5);
  status.set_frames(1000);
  status.set_skipped(7);
  status.set_fps(59.5);
  status.set_encoded(400);
  status.set_light_followed(-0.004);
  auto& camera = *status.mutable_camera();
  camera.set_backend("v4l2");
  camera.set_identity("a \"quoted\"\\name\nof two lines");
  camera.set_pixel_format("MJPEG");
  camera.set_state("streaming");
  camera.set_fps(60);
  camera.set_delivered(1001);
  camera.set_lost(1);
  camera.set_skipped(2);
  camera.set_disconnects(3);
  auto& damage = *camera.mutable_damage();
  damage.set_flagged(4);
  damage.set_markers(5);
  damage.set_too_short(6);
  damage.set_undecodable(8);
  status.mutable_ring()->set_backend("ws2812_spi");
  status.mutable_light()->set_brightness(51);
  status.mutable_calibration()->set_name("gripper");
  status.mutable_calibration()->set_method("lut");
  status.add_clients();
  status.add_endpoints()->set_certificate_days(-3);
  status.add_endpoints();
  auto& usage = *status.mutable_capture_thread();
  usage.set_minor_faults(11);
  usage.set_major_faults(12);
  usage.set_waits(13);
  usage.set_preemptions(14);
  pipeline::Histogram times;
  for (int i = 0; i < 90; ++i) times.add(15'000);
  for (int i = 0; i < 10; ++i) times.add(3'000'000'000);
  all.stages = {pipeline::summarise("total", times)};
  all.traffic = {20, 1, 300, 9, 12345};
  all.temperatures = {{"thermal_zone0", "cpu-thermal", 48.312}};
  all.reference_taken_ns = 2'000'000'000;
  return all;
}

inline std::string sample() {
  return text(overview(), {.used = 3000, .free = 500, .mapped = 2000}, 5'500'000'000);
}

}  // namespace dtact::metrics::test
