#include "clients/ctl/bench_meter.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/ctl/clock_offset.hpp"

namespace dtact::ctl {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kMs = 1'000'000;

v1::Frame frame(std::uint64_t sequence, std::int64_t captured_ns, std::uint64_t dropped = 0) {
  v1::Frame f;
  f.set_sequence(sequence);
  f.set_monotonic_ns(captured_ns);
  f.set_dropped(dropped);
  f.set_meaning(v1::TIMESTAMP_START_OF_EXPOSURE);
  return f;
}

TEST(ClockOffset, IsThatOfTheShortestRoundTrip) {
  // The other clock is 1000 ms ahead; the way there takes 1 ms and the way back 3, and once 40.
  const std::vector<ClockPing> pings = {{0, 41 * kMs, 1001 * kMs},
                                        {100 * kMs, 104 * kMs, 1101 * kMs},
                                        {200 * kMs, 260 * kMs, 1259 * kMs}};
  const ClockOffset offset = shortest_round_trip(pings);
  EXPECT_EQ(offset.at_ns, 102 * kMs);
  EXPECT_EQ(offset.offset_ns, 999 * kMs);  // 1 ms off: the ways differ by 2
  EXPECT_EQ(offset.uncertainty_ns, 2 * kMs);
}

TEST(ClockOffset, DriftsBetweenTwoEstimates) {
  const ClockOffset before{0, 10 * kMs, 0};
  const ClockOffset after{100 * kMs, 20 * kMs, 0};
  EXPECT_EQ(offset_at(before, after, 0), 10 * kMs);
  EXPECT_EQ(offset_at(before, after, 25 * kMs), 12'500'000);
  EXPECT_EQ(offset_at({}, {}, 25 * kMs), 0);
}

TEST(BenchMeter, MeasuresAStream) {
  BenchMeter meter;
  // Every 20 ms, five later by our clock; the third is 4 ms late. One was missed.
  meter.add(frame(10, 1000 * kMs, 3), 5 * kMs);
  meter.add(frame(11, 1020 * kMs, 3), 25 * kMs);
  meter.add(frame(13, 1060 * kMs, 4), 69 * kMs);
  meter.add(frame(16, 1120 * kMs, 4), 125 * kMs);
  const auto report = meter.report([](std::int64_t) { return 1000 * kMs; });
  EXPECT_EQ(report.frames(), 4U);
  EXPECT_DOUBLE_EQ(report.seconds(), 0.12);
  EXPECT_DOUBLE_EQ(report.fps(), 25);
  EXPECT_DOUBLE_EQ(report.latency_p50_ms(), 5.05);
  EXPECT_DOUBLE_EQ(report.latency_p99_ms(), 9.05);
  EXPECT_DOUBLE_EQ(report.latency_max_ms(), 9);
  EXPECT_DOUBLE_EQ(report.jitter_p50_ms(), 4.05);
  EXPECT_DOUBLE_EQ(report.jitter_max_ms(), 4);
  EXPECT_EQ(report.missed(), 1U);
  EXPECT_EQ(report.since(), v1::TIMESTAMP_START_OF_EXPOSURE);
}

TEST(BenchMeter, CountsTheBytesOnTheWire) {
  BenchMeter meter;
  v1::Frame f = frame(1, 0);
  f.mutable_depth()->set_data(std::string(1000, 'x'));
  v1::ServerMessage message;
  *message.mutable_frame() = f;
  for (int i = 0; i < 3; ++i) meter.add(f, i * 500 * kMs);
  EXPECT_DOUBLE_EQ(meter.report({}).bytes_per_second(),
                   2 * static_cast<double>(message.ByteSizeLong() + 4));
}

TEST(BenchMeter, SaysNoLatencyWithoutTheOtherClock) {
  BenchMeter meter;
  meter.add(frame(1, 1000 * kMs), 5 * kMs);
  cli::BenchReport report = meter.report({});
  EXPECT_FALSE(report.has_latency_p50_ms());
  report.set_encoding(v1::DEPTH_PREDICT_ZSTD);
  EXPECT_THAT(bench_line(report), HasSubstr("predict_zstd"));
  EXPECT_THAT(bench_line(report), HasSubstr("     -      -      -"));
  report.set_latency_p50_ms(1.25);
  EXPECT_THAT(bench_line(report), HasSubstr("   1.25"));
}

TEST(BenchMeter, SaysWhatWasRefused) {
  cli::BenchReport report;
  report.set_encoding(v1::DEPTH_INT16);
  report.set_refused("update dtactd");
  EXPECT_EQ(bench_line(report), "int16          update dtactd\n");
  EXPECT_EQ(BenchMeter().report({}).frames(), 0U);
}

}  // namespace
}  // namespace dtact::ctl
