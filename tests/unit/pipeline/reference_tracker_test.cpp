#include "daemon/pipeline/reference/reference_tracker.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "daemon/pipeline/reference/reference_store.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kPeriodNs = 16'666'667;
constexpr int kReferenceFrames = 16;
constexpr FrameState kUnsettled{.settled = false, .whole = true};

PipelineConfig config() {
  PipelineConfig made;
  made.reference.frames = kReferenceFrames;
  made.state_folder = fakes::own_path();
  return made;
}

/// The reference image of a toy sensor, whose gel has marks.
class ReferenceTrackerTest : public ::testing::Test {
 protected:
  ReferenceTrackerTest() {
    std::filesystem::remove_all(folder_);
    image_.start();
    image_.use(&calibrated_);
  }

 public:
  ~ReferenceTrackerTest() override {
    image_.stop();
    std::filesystem::remove_all(folder_);
  }

 protected:
  Observation look(const fakes::ToyFrame& frame,
                   FrameState moment = {.settled = true, .whole = true}) {
    now_ns_ += 16'666'667;
    moment.timestamp_ns = moment.now_ns = now_ns_;
    const Observation seen = image_.look(frame.view(), moment);
    image_.settle();
    return seen;
  }
  void show(int frames) {
    for (int i = 0; i < frames; ++i) (void)look(next());
  }
  /// Whether depth can be measured after three times the reference's frames, without a health flag.
  bool settles() {
    show(3 * kReferenceFrames);
    return image_.quality() == ReferenceQuality::fresh && image_.health_flags().empty();
  }
  fakes::ToyFrame next() { return fakes::ToyFrame(scene_, sequence_++); }
  void set_light(const hal::Light& light) {
    const hal::Light before = light_.light();
    light_.change_begins(light, now_ns_);
    light_.change_ends(light, now_ns_, false);
    image_.light_changed(before);
  }
  [[nodiscard]] bool has(Health health) const { return image_.health_flags().has(health); }

  PipelineConfig config_ = config();
  fakes::ToyScene scene_{.marks = 2};
  CalibratedImage calibrated_{fakes::toy_calibration(scene_)};
  CalibratedImage next_{fakes::toy_calibration(scene_)};
  std::filesystem::path folder_ = fakes::own_path();
  LightTimeline light_{config_.light, 0, kPeriodNs};
  ReferenceTracker image_{fakes::kToyWidth, fakes::kToyHeight, light_, config_};
  std::uint64_t sequence_ = 0;
  std::int64_t now_ns_ = 0;
};

TEST_F(ReferenceTrackerTest, AnotherLightThanAtCalibrationIsReportedFromTheStart) {
  hal::Light dim = config_.light;
  dim.brightness = 128;
  const LightTimeline light(dim, 0, kPeriodNs);
  ReferenceTracker dimmed(fakes::kToyWidth, fakes::kToyHeight, light, config_);
  dimmed.use(&calibrated_);
  EXPECT_TRUE(dimmed.health_flags().has(Health::light_mismatch));
  EXPECT_FALSE(has(Health::light_mismatch));
}

TEST_F(ReferenceTrackerTest, TheLightThatIsFollowedOutlivesTheCalibration) {
  ASSERT_TRUE(settles());
  constexpr int kDriftFrames = 1200;  // half a percent in twenty seconds
  for (int i = 1; i <= kDriftFrames; ++i) {
    scene_.light = 1 - 0.005 * i / kDriftFrames;
    show(1);
  }
  ASSERT_NEAR(image_.light(), 0.995, 0.001);
  image_.use(&next_);
  EXPECT_NEAR(image_.light(), 0.995, 0.001);
  show(2 * kReferenceFrames);
  EXPECT_NEAR(image_.light(), 0.995, 0.001);
  EXPECT_FALSE(has(Health::light_drifted));
  EXPECT_FALSE(image_.any_active());
}

// An object in contact drags the gel along, and its marks with it.
TEST_F(ReferenceTrackerTest, TheCamerasShiftIsNotJudgedByAGelInContact) {
  ASSERT_TRUE(settles());
  now_ns_ += CameraShiftDetector::kPauseNs;
  scene_.marks_px = 4;
  image_.set_in_contact(true);
  show(2 * kReferenceFrames);
  EXPECT_FALSE(has(Health::camera_shifted));
  image_.set_in_contact(false);
  show(2 * kReferenceFrames);
  EXPECT_TRUE(has(Health::camera_shifted));
}

TEST_F(ReferenceTrackerTest, AFrameReadInPartIsNoPartOfAReference) {
  ASSERT_TRUE(settles());
  ASSERT_EQ(image_.rezero(true), std::nullopt);
  fakes::ToyFrame part = next();
  std::fill_n(part.pixels.begin(), std::ptrdiff_t{8} * fakes::kToyWidth, std::uint8_t{0});
  EXPECT_EQ(look(part, {.settled = true, .whole = false}).rezeroed, std::nullopt);
  std::optional<Outcome> answer;
  for (int i = 0; i < kReferenceFrames; ++i) answer = look(next()).rezeroed;
  EXPECT_EQ(answer, Outcome::done);
  // 103 levels; with a sixteenth of nothing in it, 97.
  EXPECT_NEAR(image_.reference()[0], fakes::toy_reference_q8(scene_)[0], 256);
}

TEST_F(ReferenceTrackerTest, AReferenceForcedInContactIsNotKeptForTheNextStart) {
  ASSERT_TRUE(settles());
  scene_.press_mm = 1;
  ASSERT_EQ(image_.rezero(true), std::nullopt);
  show(3 * kReferenceFrames);
  constexpr std::size_t kMiddle = 60 * fakes::kToyWidth + 80;
  EXPECT_NEAR(image_.reference()[kMiddle], 119 * 256, 3 * 256);
  image_.stop();
  const auto kept =
      load_reference(*calibrated_.calibration, fakes::kToyWidth, fakes::kToyHeight, folder_);
  ASSERT_TRUE(kept.has_value());
  EXPECT_NEAR(kept->image_q8[kMiddle], 150 * 256, 3 * 256);
}

// Each write waits for the disk: 10 MB in 15 s under a flood of re-zeros.
TEST_F(ReferenceTrackerTest, ReferencesOfOneLightAreWrittenAtMostOnceInFiveMinutesAndAtTheEnd) {
  ASSERT_TRUE(settles());
  const auto inode = [&] {
    struct stat about{};
    while (::stat((folder_ / "reference.png").c_str(), &about) != 0) std::this_thread::yield();
    return about.st_ino;
  };
  const auto rezero = [&] {
    ASSERT_EQ(image_.rezero(false), std::nullopt);
    show(2 * kReferenceFrames);
  };
  const auto first = inode();
  for (int i = 0; i < 20; ++i) rezero();
  EXPECT_EQ(inode(), first);
  now_ns_ += 300'000'000'000;
  show(1);
  while (inode() == first) std::this_thread::yield();
  const auto second = inode();
  rezero();
  EXPECT_EQ(inode(), second);
  image_.stop();
  EXPECT_NE(inode(), second);
}

// Before: a client that changed the light and re-zeroed in turn had 10 MB written in 20 s.
TEST_F(ReferenceTrackerTest, ReferencesOfLightsThatChangeAreWrittenAtMostTwiceAMinute) {
  ASSERT_TRUE(settles());
  std::set<std::pair<ino_t, std::int64_t>> written;
  const std::int64_t begin_ns = now_ns_;
  for (int i = 0; i < 200; ++i) {
    hal::Light light = config_.light;
    light.brightness = i % 2 == 0 ? 128 : 200;
    set_light(light);
    scene_.light = i % 2 == 0 ? 0.9 : 1;
    show(3 * kReferenceFrames);
    struct stat about{};
    if (::stat((folder_ / "reference.png").c_str(), &about) == 0) {
      written.emplace(about.st_ino, about.st_mtim.tv_sec * 1'000'000'000 + about.st_mtim.tv_nsec);
    }
  }
  EXPECT_GE(now_ns_ - begin_ns, 150'000'000'000);
  EXPECT_LE(written.size(), 7U);
}

TEST_F(ReferenceTrackerTest, AReferenceOfAnotherLightIsWrittenAtOnce) {
  ASSERT_TRUE(settles());
  now_ns_ += 30'000'000'000;
  hal::Light dim = config_.light;
  dim.brightness = 128;
  set_light(dim);
  scene_.light = 0.9;
  show(4 * kReferenceFrames);
  ASSERT_EQ(image_.quality(), ReferenceQuality::fresh);
  const auto written = [&] {
    try {
      const auto kept =
          load_reference(*calibrated_.calibration, fakes::kToyWidth, fakes::kToyHeight, folder_);
      return kept && kept->light == dim;
    } catch (const std::exception&) {
      return false;  // one of its two files is written
    }
  };
  while (!written()) std::this_thread::yield();  // the test's time limit ends it
}

// For example, the ring re-sends its light and flickers.
TEST_F(ReferenceTrackerTest, NoDepthIsMeasuredBeforeTheLightHasSettled) {
  ASSERT_TRUE(settles());
  EXPECT_TRUE(look(next()).measurable);
  EXPECT_FALSE(look(next(), kUnsettled).measurable);
  EXPECT_TRUE(image_.ready());
  EXPECT_TRUE(look(next()).measurable);
}

// For example, the ring has no power. A camera's first pictures may be dark.
TEST_F(ReferenceTrackerTest, ReportsADarkPictureBeforeTheFirstReference) {
  scene_.light = 0.04;  // 6 levels
  show(config_.reference.settle_frames - 1);
  EXPECT_FALSE(has(Health::image_dark));
  show(1);
  EXPECT_TRUE(has(Health::image_dark));
  EXPECT_TRUE(has(Health::starting));
  scene_.light = 1;
  show(1);
  EXPECT_FALSE(has(Health::image_dark));
  EXPECT_TRUE(settles());
}

TEST_F(ReferenceTrackerTest, ReportsADarkPictureAfterTheLightIsSwitchedOff) {
  ASSERT_TRUE(settles());
  set_light({.brightness = 0});
  scene_.light = 0.04;
  show(config_.reference.settle_frames);
  EXPECT_TRUE(has(Health::image_dark));
  set_light(config_.light);
  EXPECT_FALSE(has(Health::image_dark));
}

TEST_F(ReferenceTrackerTest, WhatWasWrongWithThePictureIsNotReportedWhileTheLightChanges) {
  ASSERT_TRUE(settles());
  scene_.light = 0.12;  // 17 levels
  show(1);
  EXPECT_TRUE(has(Health::image_dark));
  scene_.light = 1;
  (void)look(next(), kUnsettled);
  EXPECT_FALSE(has(Health::image_dark));
  EXPECT_TRUE(has(Health::light_unsettled));
}

}  // namespace
}  // namespace dtact::pipeline
