#include "hal/null/null.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace dtact::hal::null {
namespace {

using std::chrono::milliseconds;

/// Time that passes only by sleeping.
class FakeClock final : public base::Clock {
 public:
  [[nodiscard]] std::int64_t monotonic_ns() const noexcept override { return now; }
  [[nodiscard]] std::int64_t wall_ns() const noexcept override { return now; }
  void sleep_until(std::int64_t deadline_ns) noexcept override { now = std::max(now, deadline_ns); }
  std::int64_t now = 1000;
};

TEST(NullCamera, KeepsTheRateAndCountsUp) {
  FakeClock clock;
  CameraConfig config;
  config.fps = 100;
  NullCamera camera(config, clock);
  camera.start();
  Frame frame;
  for (std::uint64_t i = 0; i < 3; ++i) {
    ASSERT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::ok);
    EXPECT_EQ(frame.info().sequence, i);
    EXPECT_EQ(frame.info().timestamp_ns, 1000 + static_cast<std::int64_t>(i + 1) * 10'000'000);
    EXPECT_EQ(camera.report().delivered, i + 1);
  }
  EXPECT_EQ(frame.luma().width, 800);
  EXPECT_EQ(frame.luma().row(599)[799 + kLumaPadding], NullCamera::kGrey);
}

TEST(NullCamera, TimesOutWhenTheFrameIsTooFarAway) {
  FakeClock clock;
  CameraConfig config;
  config.fps = 10;
  NullCamera camera(config, clock);
  camera.start();
  Frame frame;
  EXPECT_EQ(camera.grab(frame, milliseconds(50)), GrabStatus::timeout);
  EXPECT_FALSE(frame);
  EXPECT_EQ(camera.report().delivered, 0U);
  EXPECT_EQ(camera.grab(frame, milliseconds(60)), GrabStatus::ok);
}

}  // namespace
}  // namespace dtact::hal::null
