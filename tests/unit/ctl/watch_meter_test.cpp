#include "clients/ctl/watch_meter.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "clients/ctl/light_text.hpp"

namespace dtact::ctl {
namespace {

constexpr std::int64_t kMs = 1'000'000;

v1::Frame frame(std::int64_t captured_ns) {
  v1::Frame f;
  f.set_sequence(7);
  f.set_monotonic_ns(captured_ns);
  f.mutable_contact()->set_in_contact(true);
  f.mutable_contact()->set_area_mm2(12.34);
  f.mutable_contact()->set_deepest_mm(0.5127);
  f.set_dropped(3);
  return f;
}

TEST(LatencyHistogram, IsEmptyAtFirstAndAfterReset) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.percentile_ms(0.5), 0.0);
  histogram.add(5 * kMs);
  histogram.reset();
  EXPECT_EQ(histogram.count(), 0U);
  EXPECT_EQ(histogram.percentile_ms(0.5), 0.0);
}

TEST(LatencyHistogram, GivesTheUpperEndOfTheStep) {
  LatencyHistogram histogram;
  for (int i = 0; i < 99; ++i) histogram.add(4 * kMs);
  histogram.add(20 * kMs);
  EXPECT_DOUBLE_EQ(histogram.percentile_ms(0), 4.05);
  EXPECT_DOUBLE_EQ(histogram.percentile_ms(0.5), 4.05);
  EXPECT_DOUBLE_EQ(histogram.percentile_ms(0.99), 4.05);
  EXPECT_DOUBLE_EQ(histogram.percentile_ms(1), 20.05);
}

TEST(LatencyHistogram, TakesWhatLiesOutside) {
  LatencyHistogram histogram;
  histogram.add(-kMs);
  EXPECT_DOUBLE_EQ(histogram.percentile_ms(1), 0.05);
  histogram.add(5000 * kMs);
  EXPECT_DOUBLE_EQ(histogram.percentile_ms(1), 1000);
}

TEST(WatchMeter, CountsNothingFromOneFrame) {
  WatchMeter meter;
  EXPECT_EQ(meter.fps(), 0.0);
  meter.add(frame(0), 5 * kMs, true, true);
  EXPECT_EQ(meter.fps(), 0.0);
  EXPECT_EQ(meter.frames(), 1U);
}

TEST(WatchMeter, MeasuresTheRateBetweenFrames) {
  WatchMeter meter;
  for (int i = 0; i < 11; ++i) meter.add(frame(0), 1000 * kMs + i * 20 * kMs, true, true);
  EXPECT_DOUBLE_EQ(meter.fps(), 50);
  EXPECT_DOUBLE_EQ(meter.rate_until(1400 * kMs), 25);  // it broke off half-way
}

TEST(WatchMeter, CountsOnlyWhatHoldsDepth) {
  WatchMeter meter;
  meter.add(frame(0), 0, true, false);
  meter.add(frame(0), 100 * kMs, true, true);
  meter.add(frame(0), 200 * kMs, true, true);
  EXPECT_EQ(meter.frames(), 3U);
  EXPECT_EQ(meter.counted(), 2U);
  EXPECT_DOUBLE_EQ(meter.fps(), 10);
  meter.reset();
  EXPECT_EQ(meter.frames(), 0U);
}

TEST(WatchMeter, PrintsALine) {
  WatchMeter meter;
  meter.add(frame(0), 4 * kMs, true, true);
  meter.add(frame(16 * kMs), 20 * kMs, true, true);
  EXPECT_EQ(
      watch_line(meter, frame(0)),
      " 62.5 fps  contact   12.3 mm2  deepest  0.513 mm  latency p50 4.0 p99 4.0 ms  drops 3  "
      "ok");
}

TEST(WatchMeter, PrintsTheForceWhereItIsCalibrated) {
  WatchMeter meter;
  auto f = frame(0);
  f.mutable_contact()->set_force_n(0.517);
  f.mutable_contact()->set_force_uncertainty_n(0.0312);
  EXPECT_NE(watch_line(meter, f).find("deepest  0.513 mm  force 0.52 N +- 0.03  latency"),
            std::string::npos);
  f.mutable_contact()->clear_force_n();
  f.mutable_contact()->set_force_absence(v1::FORCE_ABSENCE_CUT_OFF);
  EXPECT_NE(watch_line(meter, f).find("deepest  0.513 mm  force cut_off  latency"),
            std::string::npos);
}

TEST(WatchMeter, PrintsNoLatencyBetweenMachines) {
  WatchMeter meter;
  auto f = frame(0);
  f.add_health(v1::HEALTH_STARTING);
  f.add_health(v1::HEALTH_NOT_REALTIME);
  meter.add(f, 4 * kMs, false, true);
  EXPECT_EQ(watch_line(meter, f),
            "  0.0 fps  contact   12.3 mm2  deepest  0.513 mm  latency -  drops 3  "
            "starting,not_realtime");
  EXPECT_FALSE(watch_report(meter, f).has_latency_p50_ms());
}

TEST(WatchMeter, SaysThatAMapIsSharpened) {
  WatchMeter meter;
  auto f = frame(0);
  f.mutable_depth()->set_uncertainty_um(18);
  f.mutable_depth()->set_sharpen_steps(2);
  EXPECT_NE(watch_line(meter, f).find("0.513 mm +- 0.018 sharpened 2x  latency"),
            std::string::npos);
}

TEST(WatchMeter, ReportsWhatItCounted) {
  WatchMeter meter;
  auto f = frame(0);
  f.add_health(v1::HEALTH_STARTING);
  meter.add(f, 4 * kMs, true, true);
  meter.add(frame(16 * kMs), 20 * kMs, true, true);
  const cli::WatchReport report = watch_report(meter, f);
  EXPECT_FALSE(report.summary());
  EXPECT_EQ(report.frames(), 2U);
  EXPECT_EQ(report.depth_frames(), 2U);
  EXPECT_EQ(report.fps(), 62.5);
  EXPECT_DOUBLE_EQ(report.latency_p50_ms(), 4.05);
  EXPECT_EQ(report.deepest_mm(), 0.5127);
  ASSERT_EQ(report.health_size(), 1);
  EXPECT_EQ(report.health(0), v1::HEALTH_STARTING);
  EXPECT_EQ(report.newest().sequence(), 7U);
}

TEST(ParseLed, TakesNumberAndColour) {
  const auto [index, colour] = parse_led("3:ff8000");
  EXPECT_EQ(index, 3);
  EXPECT_EQ(colour.r(), 255U);
  EXPECT_EQ(colour.g(), 128U);
  EXPECT_EQ(colour.b(), 0U);
}

TEST(ParseLed, RefusesTheRest) {
  for (const char* text : {"", "3", "8:ffffff", "3:fffff", "3:fffffff", "3:ffffgg", "3:-fffff",
                           "-1:ffffff", "3 ffffff", "3:0xffff"}) {
    EXPECT_THROW((void)parse_led(text), std::invalid_argument) << text;
  }
}

}  // namespace
}  // namespace dtact::ctl
