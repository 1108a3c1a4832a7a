#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <memory>
#include <stdexcept>
#include <utility>

#include "daemon/pipeline/active_calibration.hpp"
#include "daemon/pipeline/camera_watch.hpp"
#include "daemon/pipeline/light_timeline.hpp"
#include "daemon/pipeline/statistics.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kPeriod = 10 * kMs;

hal::FrameInfo numbered(std::uint64_t sequence, std::uint32_t flags = hal::kFrameNormal) {
  hal::FrameInfo info;
  info.sequence = sequence;
  info.flags = flags;
  return info;
}

TEST(CameraWatch, AGapIsRememberedForASecond) {
  CameraWatch watch(kPeriod);
  EXPECT_FALSE(watch.arrived(numbered(5), 0));
  EXPECT_FALSE(watch.lost_lately(0));
  (void)watch.arrived(numbered(6), kPeriod);
  EXPECT_FALSE(watch.lost_lately(kPeriod));
  (void)watch.arrived(numbered(8, hal::kFrameAfterGap), 100 * kMs);
  EXPECT_TRUE(watch.lost_lately(100 * kMs));
  EXPECT_TRUE(watch.lost_lately(1099 * kMs));
  EXPECT_FALSE(watch.lost_lately(1100 * kMs));
}

// The camera reports its losses; a frame that was skipped for a newer one is not a loss.
TEST(CameraWatch, ASkippedFrameIsNoLoss) {
  CameraWatch watch(kPeriod);
  (void)watch.arrived(numbered(5), 0);
  (void)watch.arrived(numbered(8), 3 * kPeriod);
  EXPECT_FALSE(watch.lost_lately(3 * kPeriod));
}

TEST(CameraWatch, KnowsAStreamOfDamagedFramesFromSilence) {
  CameraWatch watch(kPeriod);
  (void)watch.arrived(numbered(0), 0);
  watch.missed(hal::GrabStatus::damaged, 4 * kPeriod);
  EXPECT_TRUE(watch.trouble());
  EXPECT_TRUE(watch.damaged());
  watch.missed(hal::GrabStatus::timeout, 8 * kPeriod);
  EXPECT_TRUE(watch.trouble());
  EXPECT_FALSE(watch.damaged());
  watch.missed(hal::GrabStatus::damaged, 9 * kPeriod);
  (void)watch.arrived(numbered(1), 10 * kPeriod);
  EXPECT_FALSE(watch.damaged());
}

TEST(CameraWatch, DamageCountsAsLossToo) {
  CameraWatch watch(kPeriod);
  (void)watch.arrived(numbered(0), 0);
  watch.missed(hal::GrabStatus::damaged, 2000 * kMs);
  EXPECT_TRUE(watch.lost_lately(2000 * kMs));
}

TEST(CameraWatch, ADeviceOpenedAnewHasReturnedThoughItWasNeverAway) {
  CameraWatch watch(kPeriod);
  EXPECT_FALSE(watch.arrived(numbered(0), 0));
  watch.missed(hal::GrabStatus::timeout, 400 * kPeriod);
  EXPECT_TRUE(watch.arrived(numbered(1, hal::kFrameReopened), 401 * kPeriod));
  EXPECT_FALSE(watch.arrived(numbered(2), 402 * kPeriod));
}

TEST(CameraWatch, ARepeatedNumberIsNoLoss) {
  CameraWatch watch(kPeriod);
  (void)watch.arrived(numbered(3), 0);
  (void)watch.arrived(numbered(3), kPeriod);
  EXPECT_FALSE(watch.lost_lately(kPeriod));
}

TEST(CameraWatch, SilenceOfThreePeriodsIsTrouble) {
  CameraWatch watch(kPeriod);
  watch.started(0);
  watch.missed(hal::GrabStatus::timeout, 3 * kPeriod);
  EXPECT_FALSE(watch.trouble());
  watch.missed(hal::GrabStatus::timeout, 3 * kPeriod + 1);
  EXPECT_TRUE(watch.trouble());
  EXPECT_FALSE(watch.away());
  EXPECT_FALSE(watch.arrived(numbered(0), 4 * kPeriod));
  EXPECT_FALSE(watch.trouble());
}

TEST(CameraWatch, ReturningIsReportedOnceAndIsNoGap) {
  CameraWatch watch(kPeriod);
  (void)watch.arrived(numbered(100), 0);
  watch.missed(hal::GrabStatus::unplugged, kPeriod);
  EXPECT_TRUE(watch.away());
  EXPECT_TRUE(watch.trouble());
  EXPECT_TRUE(watch.arrived(numbered(900), 2 * kPeriod));
  EXPECT_FALSE(watch.lost_lately(2 * kPeriod));
  EXPECT_FALSE(watch.arrived(numbered(901), 3 * kPeriod));
}

/// Adds `frames` frames at intervals of `ns`.
void add_frames(RateWatch& watch, hal::FrameInfo& info, int frames, std::int64_t ns) {
  for (int i = 0; i < frames; ++i) {
    ++info.sequence;
    info.timestamp_ns += ns;
    watch.add(info);
  }
}

TEST(RateWatch, NamesACameraThatHalvesItsRateWithinASecond) {
  RateWatch watch(kPeriod);
  hal::FrameInfo info;
  add_frames(watch, info, 100, kPeriod);
  EXPECT_EQ(watch.fps(), 0);  // 99 intervals
  add_frames(watch, info, 1, kPeriod);
  EXPECT_DOUBLE_EQ(watch.fps(), 100);
  EXPECT_FALSE(watch.slow());
  add_frames(watch, info, 50, 2 * kPeriod);
  EXPECT_DOUBLE_EQ(watch.fps(), 50);
  EXPECT_TRUE(watch.slow());
  add_frames(watch, info, 100, kPeriod);
  EXPECT_FALSE(watch.slow());
}

TEST(RateWatch, LostFramesAreNoSlowCamera) {
  RateWatch watch(kPeriod);
  hal::FrameInfo info;
  for (int i = 0; i < 60; ++i) {
    ++info.sequence;  // every other frame is lost
    info.timestamp_ns += kPeriod;
    add_frames(watch, info, 1, kPeriod);
  }
  EXPECT_DOUBLE_EQ(watch.fps(), 100);
  EXPECT_FALSE(watch.slow());
}

TEST(RateWatch, OneLongPauseIsNoSlowCamera) {
  RateWatch watch(kPeriod);
  hal::FrameInfo info;
  add_frames(watch, info, 4, kPeriod);
  add_frames(watch, info, 1, 500 * kPeriod);
  add_frames(watch, info, 10, kPeriod);
  EXPECT_DOUBLE_EQ(watch.fps(), 100);
}

TEST(RateWatch, ATenthLessIsReportedAndAClocksErrorIsNot) {
  RateWatch watch(kPeriod);
  hal::FrameInfo info;
  add_frames(watch, info, 101, kPeriod * 110 / 100);
  EXPECT_FALSE(watch.slow());
  add_frames(watch, info, 101, kPeriod * 112 / 100);
  EXPECT_TRUE(watch.slow());
}

// Intervals are gathered for a second, but no more than 256 and no fewer than five.
TEST(RateWatch, KnowsAFastCamerasRateAfter256Intervals) {
  RateWatch watch(kMs);
  hal::FrameInfo info;
  add_frames(watch, info, 256, kMs);
  EXPECT_EQ(watch.fps(), 0);  // 255 intervals
  add_frames(watch, info, 1, kMs);
  EXPECT_DOUBLE_EQ(watch.fps(), 1000);
}

TEST(RateWatch, KnowsASlowCamerasRateAfterFiveIntervals) {
  RateWatch watch(2000 * kMs);
  hal::FrameInfo info;
  add_frames(watch, info, 5, 2000 * kMs);
  EXPECT_EQ(watch.fps(), 0);  // four intervals
  add_frames(watch, info, 1, 2000 * kMs);
  EXPECT_DOUBLE_EQ(watch.fps(), 0.5);
  EXPECT_FALSE(watch.slow());
}

TEST(RateWatch, BeginsAnewWithACameraOpenedAnew) {
  CameraWatch watch(kPeriod);
  std::int64_t at_ns = 0;
  std::uint64_t sequence = 0;
  const auto arrive = [&](std::uint32_t flags, std::int64_t after_ns) {
    hal::FrameInfo info = numbered(++sequence, flags);
    info.timestamp_ns = at_ns += after_ns;
    (void)watch.arrived(info, at_ns);
  };
  for (int i = 0; i < 60; ++i) arrive(hal::kFrameNormal, 2 * kPeriod);
  EXPECT_TRUE(watch.rate().slow());
  arrive(hal::kFrameReopened, kPeriod);
  EXPECT_FALSE(watch.rate().slow());
  EXPECT_EQ(watch.rate().fps(), 0);
}

class SkippedFrames : public testing::Test {
 protected:
  /// Every `step`-th frame of the camera arrives.
  void add(int frames, std::uint64_t step) {
    for (int i = 0; i < frames; ++i) {
      info.sequence += step;
      info.timestamp_ns += static_cast<std::int64_t>(step) * kPeriod;
      watch.add(info);
    }
  }

  SkipWatch watch;
  hal::FrameInfo info;
};

TEST_F(SkippedFrames, NamesAMachineThatLeavesOutMoreThanAFifth) {
  add(150, 1);
  add(30, 2);  // 30 of 210 in two seconds
  EXPECT_FALSE(watch.behind());
  add(100, 3);  // two of three
  EXPECT_TRUE(watch.behind());
  add(400, 1);
  EXPECT_FALSE(watch.behind());
}

TEST_F(SkippedFrames, AFifthIsAllowed) {
  add(1, 1);
  add(120, 1);
  add(40, 2);  // 40 of 200, in two seconds
  EXPECT_FALSE(watch.behind());
  add(118, 1);
  add(40, 2);
  EXPECT_FALSE(watch.behind()) << "the two seconds are not over";
  add(1, 2);  // 41 of 200
  EXPECT_TRUE(watch.behind());
}

TEST(SkipWatch, WhatTheCameraLostIsNotSkipped) {
  SkipWatch watch;
  hal::FrameInfo info;
  info.flags = hal::kFrameAfterGap;
  for (int i = 0; i < 100; ++i) {
    info.sequence += 5;
    info.timestamp_ns += 5 * kPeriod;
    watch.add(info);
  }
  EXPECT_FALSE(watch.behind());
}

TEST(SkipWatch, DamagedFramesAreNotSkipped) {
  SkipWatch watch;
  hal::FrameInfo info;
  for (int i = 0; i < 300; ++i) {
    info.sequence += 2;
    info.timestamp_ns += 2 * kPeriod;
    watch.add_damaged();
    watch.add(info);
  }
  EXPECT_FALSE(watch.behind());
}

TEST(SkipWatch, OneFrameInSecondsIsTooSlow) {
  SkipWatch watch;
  hal::FrameInfo info;
  watch.add(info);
  info.sequence = 300;
  info.timestamp_ns = 300 * kPeriod;
  watch.add(info);
  EXPECT_TRUE(watch.behind());
}

TEST(LightTimeline, ExposureBeginsAPeriodBeforeTheFramesEnd) {
  hal::FrameInfo info;
  info.timestamp_ns = 50 * kMs;
  info.meaning = hal::TimestampMeaning::first_packet;
  EXPECT_EQ(exposure_start_ns(info, kPeriod), 40 * kMs);
  info.meaning = hal::TimestampMeaning::end_of_frame;
  EXPECT_EQ(exposure_start_ns(info, kPeriod), 40 * kMs);
  info.meaning = hal::TimestampMeaning::arrival;
  EXPECT_EQ(exposure_start_ns(info, kPeriod), 40 * kMs);
  info.meaning = hal::TimestampMeaning::start_of_exposure;
  EXPECT_EQ(exposure_start_ns(info, kPeriod), 50 * kMs);
}

TEST(LightTimeline, FramesBelongToTheLightTheyWereExposedUnder) {
  const hal::Light bright;
  hal::Light dim;
  dim.brightness = 100;
  LightTimeline timeline(bright, 2, kPeriod);
  EXPECT_TRUE(timeline.settled_at(0));
  timeline.change_begins(dim, 100 * kMs);
  EXPECT_EQ(timeline.light_at(99 * kMs).brightness, 255);
  EXPECT_EQ(timeline.light_at(100 * kMs).brightness, 100);
  EXPECT_FALSE(timeline.settled_at(1000 * kMs));  // still writing
  timeline.change_ends(dim, 101 * kMs, false);
  EXPECT_FALSE(timeline.settled_at(120 * kMs));
  EXPECT_TRUE(timeline.settled_at(121 * kMs));  // 101 + 2 periods
  hal::Light dark;
  dark.brightness = 3;
  timeline.change_begins(dark, 200 * kMs);
  EXPECT_EQ(timeline.light_at(199 * kMs).brightness, 100);
  EXPECT_EQ(timeline.light_at(200 * kMs).brightness, 3);
}

TEST(LightTimeline, KnowsSinceWhenAnExposureShowsALightAlone) {
  hal::Light dim;
  dim.brightness = 100;
  LightTimeline timeline({}, 2, kPeriod);
  EXPECT_EQ(timeline.since_at(50 * kMs), std::nullopt) << "who knows what was before the start";
  timeline.change_begins({}, 100 * kMs);
  EXPECT_EQ(timeline.since_at(100 * kMs), std::nullopt) << "still writing";
  timeline.change_ends({}, 101 * kMs, false);
  EXPECT_EQ(timeline.since_at(99 * kMs), std::nullopt);
  EXPECT_EQ(timeline.since_at(100 * kMs), 121 * kMs);  // 101 + 2 periods
  timeline.change_begins(dim, 200 * kMs);
  EXPECT_EQ(timeline.since_at(199 * kMs), 121 * kMs);
  EXPECT_EQ(timeline.since_at(200 * kMs), std::nullopt);
  timeline.change_ends({}, 201 * kMs, true);
  EXPECT_EQ(timeline.since_at(300 * kMs), std::nullopt) << "a failed write may have shown anything";
  EXPECT_EQ(stamp_lag_ns(hal::TimestampMeaning::start_of_exposure, kPeriod), 0);
  EXPECT_EQ(stamp_lag_ns(hal::TimestampMeaning::end_of_frame, kPeriod), kPeriod);
}

TEST(LightTimeline, AFailedWriteLeavesTheOldLight) {
  const hal::Light bright;
  hal::Light dim;
  dim.brightness = 100;
  LightTimeline timeline(bright, 0, kPeriod);
  timeline.change_begins(dim, 100 * kMs);
  timeline.change_ends(bright, 105 * kMs, true);
  EXPECT_EQ(timeline.light_at(200 * kMs).brightness, 255);
  EXPECT_TRUE(timeline.settled_at(105 * kMs));
}

TEST(LightDiffers, ComparesAfterBrightness) {
  const auto calibration = fakes::toy_calibration();  // full white
  hal::Light light;
  EXPECT_FALSE(light_differs(*calibration, light));
  light.brightness = 254;  // one step: not reported
  EXPECT_FALSE(light_differs(*calibration, light));
  light.brightness = 253;
  EXPECT_TRUE(light_differs(*calibration, light));
  light.brightness = 255;
  light.leds[7].b = 0;
  EXPECT_TRUE(light_differs(*calibration, light));
  calibration->origin.leds.clear();  // not recorded
  EXPECT_FALSE(light_differs(*calibration, light));
}

// White at brightness 128 emits 56 of 255 along a gamma of 2.2, and 128 along none.
TEST(LightDiffers, ComparesAlongTheRingsGamma) {
  const auto calibration = fakes::toy_calibration();
  const hal::Light dimmed{.brightness = 128, .gamma = 2.2};
  calibration->origin.leds.assign(std::size_t{3} * hal::kLedCount, 56);
  EXPECT_FALSE(light_differs(*calibration, dimmed));
  EXPECT_TRUE(light_differs(*calibration, {.brightness = 128}));
  calibration->origin.leds.assign(std::size_t{3} * hal::kLedCount, 128);
  EXPECT_TRUE(light_differs(*calibration, dimmed));
  EXPECT_FALSE(light_differs(
      *calibration, {.leds = hal::Light::all({128, 128, 128}), .brightness = 255, .gamma = 2.2}));
}

TEST(Activate, NamesTheLutThatSharpeningNeeds) {
  hal::CameraInfo camera;
  camera.width = fakes::kToyWidth;
  camera.height = fakes::kToyHeight;
  EXPECT_THAT(
      [&] { (void)activate(fakes::toy_calibration(), camera, {.sharpen = 2}); },
      testing::ThrowsMessage<std::invalid_argument>(testing::AllOf(
          testing::HasSubstr("reconstruction.sharpen is 2"), testing::HasSubstr("\"auto\""))));
  EXPECT_NO_THROW((void)activate(fakes::toy_calibration(), camera,
                                 {.sharpen = ReconstructionRules::kAutoSharpen}));
}

TEST(Activate, NamesAFrameSizeThatDoesNotFit) {
  hal::CameraInfo camera;
  camera.width = 320;
  camera.height = 240;
  try {
    (void)activate(fakes::toy_calibration(), camera, {});
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_STREQ(
        e.what(),
        "calibration \"toy\" is for frames of 160x120 pixels, the camera delivers 320x240: "
        "set camera.width, camera.height and camera.decode_scale to the calibration's, or "
        "calibrate in this mode");
  }
}

TEST(Activate, TakesACalibrationForTheJpegsOrForTheDecodedFrames) {
  hal::CameraInfo camera;
  camera.width = fakes::kToyWidth / 2;
  camera.height = fakes::kToyHeight / 2;
  camera.decode_scale = 2;
  const auto toy = fakes::toy_calibration();
  const auto active = activate(toy, camera, {});
  const recon::Model& model = *active->image.calibration->model;
  EXPECT_EQ(model.rectify.frame_width, fakes::kToyWidth / 2);
  EXPECT_EQ(model.frame_scale, 2);
  EXPECT_EQ(active->maps.shape().decimation, 2);
  EXPECT_FALSE(active->camera_mismatch);

  const auto own = std::make_shared<const calibration::Calibration>(*active->image.calibration);
  EXPECT_EQ(activate(own, camera, {})->image.calibration, own) << "made for these frames";
  camera.decode_scale = 4;
  EXPECT_THAT([&] { (void)activate(toy, camera, {}); },
              testing::ThrowsMessage<std::invalid_argument>(
                  testing::HasSubstr("the camera delivers 80x60 (decoded from 320x240)")));
}

// The frame is 40 by 30 cells of four pixels; eight cells each way are needed.
TEST(Activate, RefusesAPartOfFewerThanEightCellsEachWay) {
  hal::CameraInfo camera;
  camera.width = fakes::kToyWidth;
  camera.height = fakes::kToyHeight;
  const auto use = [&camera](int width, int height) {
    auto toy = fakes::toy_calibration();
    recon::Model model = *toy->model;
    model.rectify =
        recon::make_crop_table(fakes::kToyWidth, fakes::kToyHeight, 8, 12, width, height);
    toy->model = std::make_shared<const recon::Model>(std::move(model));
    return activate(toy, camera, {})->image.region;
  };
  EXPECT_EQ(use(32, 100), (CellRegion{.x0 = 2, .y0 = 3, .x1 = 10, .y1 = 28}));
  EXPECT_EQ(use(140, 32), (CellRegion{.x0 = 2, .y0 = 3, .x1 = 37, .y1 = 11}));
  const auto refused = [&use](int width, int height, const char* size) {
    EXPECT_THAT([&] { (void)use(width, height); },
                testing::ThrowsMessage<std::invalid_argument>(
                    testing::AllOf(testing::HasSubstr("\"toy\""), testing::HasSubstr(size))));
  };
  refused(28, 100, "covers 28x100 pixels");
  refused(140, 28, "covers 140x28 pixels");
}

TEST(Activate, KnowsTheCellsOfTheCalibratedPart) {
  hal::CameraInfo camera;
  camera.width = 160;
  camera.height = 120;
  const auto active = activate(fakes::toy_calibration(), camera, {});
  EXPECT_EQ(active->image.region, (CellRegion{.x0 = 2, .y0 = 2, .x1 = 38, .y1 = 28}));
  EXPECT_FALSE(active->camera_mismatch);
  auto other = fakes::toy_calibration();
  other->origin.camera = "another";
  EXPECT_TRUE(activate(other, camera, {})->camera_mismatch);
}

TEST(Statistics, CountsFramesOfTheLastSecond) {
  Statistics statistics;
  EXPECT_EQ(statistics.fps(0), 0);
  EXPECT_TRUE(statistics.stages().empty());
  for (int i = 0; i <= 100; ++i) statistics.add({}, false, i * kPeriod, i * kPeriod + kMs);
  EXPECT_DOUBLE_EQ(statistics.fps(1001 * kMs), 100);
  EXPECT_EQ(statistics.fps(5000 * kMs), 0);
  ASSERT_EQ(statistics.stages().size(), 2U);  // nothing was reconstructed
  statistics.add({.activity_ns = 3'000, .rectify_ns = 50'000, .publish_ns = 7'000}, true, 0,
                 2 * kMs);
  const auto stages = statistics.stages();
  ASSERT_EQ(stages.size(), 8U);
  EXPECT_EQ(stages[1].stage, "activity");
  EXPECT_DOUBLE_EQ(stages[1].max_us, 3);
  EXPECT_EQ(stages[2].stage, "rectify");
  EXPECT_DOUBLE_EQ(stages[2].max_us, 50);
  EXPECT_EQ(stages[6].stage, "publish");
  EXPECT_DOUBLE_EQ(stages[6].max_us, 7);
  EXPECT_EQ(stages[7].stage, "total");
  EXPECT_DOUBLE_EQ(stages[7].max_us, 2000);
}

TEST(Statistics, KnowsThePagesItsThreadFaultedOnceASecondIsOver) {
  constexpr std::size_t kPages = 100;
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  void* const fresh =
      ::mmap(nullptr, kPages * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(fresh, MAP_FAILED);
  ASSERT_EQ(::madvise(fresh, kPages * page, MADV_NOHUGEPAGE), 0);
  Statistics statistics;
  statistics.add({}, false, 0, 0);
  statistics.add({}, false, 0, 1000 * kMs);
  const ThreadUsage before = statistics.usage();
  for (std::size_t i = 0; i < kPages; ++i) static_cast<volatile char*>(fresh)[i * page] = 1;
  statistics.add({}, false, 0, 1500 * kMs);
  EXPECT_EQ(statistics.usage().minor_faults, before.minor_faults);
  statistics.add({}, false, 0, 2000 * kMs);
  EXPECT_GE(statistics.usage().minor_faults, before.minor_faults + kPages);
  ::munmap(fresh, kPages * page);
}

}  // namespace
}  // namespace dtact::pipeline
