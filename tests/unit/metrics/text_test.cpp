#include "daemon/metrics/text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/fakes/own_path.hpp"
#include "tests/unit/metrics/sample.hpp"

namespace dtact::metrics {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(MetricsText, SaysTheStateOnce) {
  const std::string text = test::sample();
  EXPECT_THAT(text, AllOf(HasSubstr("dtactd_build_info{version=\"9.8.7\"} 1\n"),
                          HasSubstr("dtactd_state{state=\"serving\"} 1\n"),
                          HasSubstr("dtactd_state{state=\"camera_lost\"} 0\n"),
                          HasSubstr("dtactd_health_flag{flag=\"not_realtime\"} 1\n"),
                          HasSubstr("dtactd_health_flag{flag=\"exposure_unlocked\"} 0\n")));
}

TEST(MetricsText, CountsDropsByCause) {
  const std::string text = test::sample();
  for (const char* line : {"lost\"} 1\n", "skipped\"} 2\n", "damaged_flagged\"} 4\n",
                           "damaged_markers\"} 5\n", "damaged_too_short\"} 6\n",
                           "damaged_undecodable\"} 8\n", "replaced\"} 7\n", "slow_client\"} 9\n"}) {
    EXPECT_THAT(text, HasSubstr(std::string("dtactd_frames_dropped_total{cause=\"") + line));
  }
  EXPECT_THAT(text,
              AllOf(HasSubstr("dtactd_frames_total 1000\n"),
                    HasSubstr("dtactd_camera_frames_delivered_total 1001\n"),
                    HasSubstr("dtactd_frames_sent_total 300\n"),
                    HasSubstr("dtactd_sent_bytes_total 12345\n"),
                    HasSubstr("dtactd_connections_refused_total 1\n"),
                    HasSubstr("dtactd_certificate_days -3\n"), HasSubstr("dtactd_clients 1\n")));
}

TEST(MetricsText, IsInBaseUnits) {
  EXPECT_THAT(
      test::sample(),
      AllOf(HasSubstr("dtactd_stage_duration_seconds_bucket{stage=\"total\",le=\"1e-05\"} 0\n"),
            HasSubstr("dtactd_stage_duration_seconds_bucket{stage=\"total\",le=\"2e-05\"} 90\n"),
            HasSubstr("dtactd_stage_duration_seconds_bucket{stage=\"total\",le=\"1\"} 90\n"),
            HasSubstr("dtactd_stage_duration_seconds_bucket{stage=\"total\",le=\"+Inf\"} 100\n"),
            HasSubstr("dtactd_stage_duration_seconds_count{stage=\"total\"} 100\n"),
            HasSubstr("dtactd_stage_duration_seconds_sum{stage=\"total\"} 30.0013"),
            HasSubstr("dtactd_reference_age_seconds 3.5\n"),
            HasSubstr("dtactd_light_brightness_ratio 0.2"),
            HasSubstr("_temperature_celsius{zone=\"thermal_zone0\",type=\"cpu-thermal\"} 48.312")));
}

TEST(MetricsText, ReportsLeakedFromKeptMemory) {
  EXPECT_THAT(test::sample(), AllOf(HasSubstr("dtactd_heap_bytes{kind=\"used\"} 1000\n"),
                                    HasSubstr("dtactd_heap_bytes{kind=\"mapped\"} 2000\n"),
                                    HasSubstr("dtactd_heap_bytes{kind=\"kept\"} 500\n")));
}

TEST(Heap, CountsWhatIsInUse) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers bring an allocator of their own";
#endif
  constexpr std::size_t kSmall = 1000;
  constexpr std::size_t kCount = 1000;
  constexpr std::size_t kLarge = std::size_t{64} << 20U;
  const base::Heap before = base::heap();
  std::vector<std::string> blocks(kCount, std::string(kSmall, 'x'));
  blocks.emplace_back(kLarge, 'x');
  const base::Heap now = base::heap();
  EXPECT_GE(now.used - now.mapped, before.used - before.mapped + kCount * kSmall);
  EXPECT_GE(now.mapped, before.mapped + kLarge);
  EXPECT_GE(now.used, before.used + kLarge + kCount * kSmall);
  EXPECT_GT(now.free, 0U);
}

TEST(MetricsText, LeavesOutWhatIsNotKnown) {
  const std::string text = metrics::text({}, {}, 0);
  EXPECT_THAT(text, AllOf(Not(HasSubstr("reference_age")), Not(HasSubstr("calibration_info")),
                          Not(HasSubstr("temperature"))));
}

TEST(Temperatures, AreThoseThatAnswer) {
  const fs::path folder = fakes::own_path();
  const auto zone = [&](const char* name, const char* type, const char* temp) {
    fs::create_directories(folder / name);
    std::ofstream(folder / name / "type") << type << '\n';
    if (temp != nullptr) std::ofstream(folder / name / "temp") << temp << '\n';
  };
  zone("thermal_zone1", "gpu", "-5250");
  zone("thermal_zone0", "cpu-thermal", "48312");
  zone("thermal_zone2", "asleep", nullptr);
  zone("cooling_device0", "fan", "0");
  const auto found = base::temperatures(folder);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].zone, "thermal_zone0");
  EXPECT_EQ(found[0].type, "cpu-thermal");
  EXPECT_DOUBLE_EQ(found[0].celsius, 48.312);
  EXPECT_DOUBLE_EQ(found[1].celsius, -5.25);
  EXPECT_TRUE(base::temperatures(folder / "none").empty());
  fs::remove_all(folder);
}

}  // namespace
}  // namespace dtact::metrics
