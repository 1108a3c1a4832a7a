#include "daemon/pipeline/capture_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <string>

#include "tests/fakes/stepped_loop.hpp"

// begin() of the fake sets the optionals.
// NOLINTBEGIN(bugprone-unchecked-optional-access)
namespace dtact::pipeline {
namespace {

using fakes::SteppedLoop;
using fakes::toy_calibration;

// Without it 991 µm are served where 960 are true.
TEST(CaptureLoop, FollowsTheLightBesideAPressThatLasts) {
  SteppedLoop loop(10);
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.step(50);
  loop.camera.scene.x_px = 32;
  loop.camera.scene.y_px = 32;
  loop.camera.scene.press_mm = 1;
  loop.step(50);
  const double before_mm = loop.frame->contact.deepest_mm;
  EXPECT_NEAR(before_mm, 0.99, 0.02);
  for (int i = 1; i <= 1200; ++i) {  // two minutes
    loop.camera.scene.light = 1 - 0.006 * i / 1200;
    loop.step(1);
  }
  EXPECT_NEAR(loop.frame->contact.deepest_mm, before_mm, 0.010);
  EXPECT_NEAR(loop.exchange.light_followed, -0.006, 0.001);
  EXPECT_TRUE(loop.frame->health.empty());
  // Other maps of the same calibration keep the known state of the light.
  const auto model = toy_calibration()->model;
  ASSERT_TRUE(loop.submit(
      SetReconstruction{{},
                        std::make_shared<Resolutions>(model, recon::CellLattice(model->rectify),
                                                      loop.config.reconstruction)}));
  loop.step(2);
  EXPECT_NEAR(loop.frame->contact.deepest_mm, before_mm, 0.010);
  EXPECT_NEAR(loop.exchange.light_followed, -0.006, 0.001);
}

TEST(CaptureLoop, ACameraThatHalvesItsRateIsNamedWithoutLosses) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.slower = 2;
  ASSERT_TRUE(loop.until([&] { return loop.health().has(Health::camera_slow); }, 60));
  EXPECT_FALSE(loop.health().has(Health::frames_lost));
  EXPECT_NEAR(loop.exchange.camera_fps, 30, 0.01);
  loop.camera.slower = 1;
  ASSERT_TRUE(loop.until([&] { return loop.health().empty(); }, 120));
}

TEST(CaptureLoop, AMachineThatCannotKeepUpIsNamed) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  ASSERT_TRUE(loop.until(
      [&] {
        loop.camera.sequence += 2;  // skipped for the next
        return loop.health().has(Health::machine_slow);
      },
      500));
  EXPECT_FALSE(loop.health().has(Health::frames_lost));
  ASSERT_TRUE(loop.until([&] { return loop.health().empty(); }, 500));
}

// A daemon that cannot keep up skips frames: the cable is not the cause.
TEST(CaptureLoop, FramesThatWereSkippedAreNotLost) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.sequence += 2;
  loop.step(2);
  EXPECT_FALSE(loop.health().has(Health::frames_lost));
}

TEST(CaptureLoop, AStreamOfDamagedFramesIsReportedFromSilence) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.status = hal::GrabStatus::damaged;
  loop.step(5);
  EXPECT_TRUE(loop.health().has(Health::camera_fault));
  EXPECT_TRUE(loop.exchange.camera_damaged);
  loop.camera.status = hal::GrabStatus::ok;
  loop.step(1);
  EXPECT_FALSE(loop.health().has(Health::camera_fault));
  EXPECT_FALSE(loop.exchange.camera_damaged);
}

TEST(CaptureLoop, TheConfiguredDelayOfTheLightTakesThePlaceOfTheCameras) {
  SteppedLoop loop(100);
  loop.config.light_delay_frames = 5;  // the camera states two
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.light->start();  // writes to the ring
  loop.light->stop();
  loop.step(4);
  EXPECT_TRUE(loop.health().has(Health::light_unsettled));
  loop.step(1);
  EXPECT_TRUE(loop.health().empty());
}

// A change of light that is too fast to follow is part of the map's uncertainty.
TEST(CaptureLoop, StatesWhatOfTheLightItDoesNotFollow) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.step(120);
  const double before_um = loop.frame->uncertainty_um;
  loop.camera.scene.light = 0.99;
  loop.step(120);
  EXPECT_TRUE(loop.frame->health.has(Health::light_drifted));
  // 1 % of 141 grey levels, 32 µm each.
  EXPECT_NEAR(loop.frame->uncertainty_um, std::hypot(before_um, 45), 3);
}

// Too much of the field changes for the light to be measured beside it.
TEST(CaptureLoop, StatesHowFarTheLightMayHaveMovedOutOfSight) {
  SteppedLoop loop(10);
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.step(50);
  loop.camera.scene.tilt = 0.3;
  loop.step(20);
  const double before_um = loop.frame->uncertainty_um;
  loop.step(600);  // 2 % a minute, half of it to be expected: 45 µm
  EXPECT_NEAR(loop.frame->uncertainty_um, std::hypot(before_um, 45), 3);
}

TEST(CaptureLoop, AStaleReferenceIsInTheUncertainty) {
  const auto stated_um = [](bool restored) {
    SteppedLoop loop;
    loop.camera.scene.press_mm = 1;
    loop.begin(toy_calibration());
    if (restored) loop.loop->tracker().restore(fakes::toy_reference_q8(), loop.config.light);
    EXPECT_TRUE(loop.until([&] { return loop.frame != nullptr && loop.frame->has_depth; }));
    EXPECT_NE(loop.frame->health.has(Health::reference_stale), restored);
    return loop.frame->uncertainty_um;
  };
  EXPECT_NEAR(stated_um(false), std::hypot(stated_um(true), 30), 1);
}

TEST(CaptureLoop, AReferenceFromAnotherBrightnessIsNotTheLastGoodOne) {
  SteppedLoop loop;
  loop.camera.scene.press_mm = 1;
  loop.begin(toy_calibration());
  hal::Light dim;
  dim.brightness = 128;
  loop.loop->tracker().restore(fakes::toy_reference_q8(), dim);
  ASSERT_TRUE(loop.until([&] { return loop.frame != nullptr && loop.frame->has_depth; }));
  EXPECT_TRUE(loop.frame->health.has(Health::reference_stale));
  EXPECT_FALSE(loop.frame->health.has(Health::reference_restored));
}

TEST(CaptureLoop, AGoodCalibrationTakesThePlaceOfAnUnusableOne) {
  SteppedLoop loop;
  loop.begin(nullptr, true);
  loop.step(2);
  EXPECT_TRUE(loop.health().has(Health::camera_mismatch));
  ASSERT_TRUE(loop.use(toy_calibration()));
  ASSERT_TRUE(loop.until_fresh());
  EXPECT_FALSE(loop.health().has(Health::camera_mismatch));
}

// Depth is measured all the same: the lens may be as it was.
TEST(CaptureLoop, ACalibrationOfAnotherCameraIsReportedAsLongAsItIsInUse) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  const auto other = toy_calibration();
  other->origin.camera = "another";
  ASSERT_TRUE(loop.use(other));
  loop.step(2);
  EXPECT_TRUE(loop.health().has(Health::camera_mismatch));
  EXPECT_TRUE(loop.frame->health.has(Health::camera_mismatch));
  EXPECT_TRUE(loop.frame->has_depth);
  ASSERT_TRUE(loop.use(toy_calibration()));
  loop.step(2);
  EXPECT_FALSE(loop.health().has(Health::camera_mismatch));
}

TEST(CaptureLoop, ACalibrationOutOfUseIsHeldByNobody) {
  SteppedLoop loop;
  const auto first = toy_calibration();
  loop.begin(first);
  ASSERT_TRUE(loop.until_fresh());
  ASSERT_TRUE(loop.use(toy_calibration()));
  loop.step(30);
  ASSERT_EQ(loop.all<CommandDone>().size(), 1U);
  loop.events.clear();  // it came back with its successor's command
  EXPECT_EQ(first.use_count(), 1) << "the watch on the camera's place, for one, has the new one";
}

TEST(CaptureLoop, ACameraOpenedAnewBeginsAnew) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  const std::size_t taken = loop.all<ReferenceTaken>().size();
  // A stall: the camera was never away. The controls are set again, and the image is another.
  loop.camera.status = hal::GrabStatus::timeout;
  loop.step(200);
  loop.camera.status = hal::GrabStatus::ok;
  loop.camera.flags = hal::kFrameReopened;
  loop.camera.scene.light = 0.9;
  loop.step(1);
  EXPECT_TRUE(loop.frame == nullptr || !loop.frame->has_depth) << "no depth in the old light";
  EXPECT_TRUE(loop.health().has(Health::starting));
  ASSERT_TRUE(loop.until_fresh());
  EXPECT_EQ(loop.all<ReferenceTaken>().size(), taken + 1);
  loop.camera.scene.press_mm = 0.5;
  loop.step(10);
  EXPECT_NEAR(loop.frame->contact.deepest_mm, 0.5, 0.02);
}

// Another program had changed the exposure, and the reference was taken before it was set back.
TEST(CaptureLoop, AControlThatIsSetBackBeginsAnewOnce) {
  SteppedLoop loop;
  loop.camera.scene.light = 0.8;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  ASSERT_EQ(loop.all<ReferenceTaken>().size(), 1U);
  loop.camera.scene.light = 1;
  for (int i = 0; i < 60; ++i) {  // a second
    loop.camera.flags = hal::kFrameControlsMoved;
    loop.step(1);
  }
  EXPECT_TRUE(loop.health().has(Health::camera_mismatch));
  EXPECT_EQ(loop.all<ReferenceTaken>().size(), 2U);
  loop.step(100);
  EXPECT_TRUE(loop.health().empty());
  loop.camera.scene.press_mm = 0.5;
  loop.step(10);
  EXPECT_NEAR(loop.frame->contact.deepest_mm, 0.5, 0.02);
}

// Before: a camera that was unplugged then was said to differ, for as long as it was away.
TEST(CaptureLoop, WhatIsSaidOfControlsGoesWithTheCamera) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.flags = hal::kFrameControlsMoved;
  loop.step(1);
  EXPECT_TRUE(loop.health().has(Health::camera_mismatch));
  loop.camera.status = hal::GrabStatus::unplugged;
  loop.step(2);
  EXPECT_TRUE(loop.health().has(Health::camera_fault));
  EXPECT_FALSE(loop.health().has(Health::camera_mismatch));
}

// Before: for as long as the camera was away, what its last picture showed was said to be so now.
TEST(CaptureLoop, WhatIsSaidOfThePictureGoesWithTheCamera) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.scene.press_mm = 3;
  loop.camera.slower = 2;
  ASSERT_TRUE(loop.until([&] {
    return loop.health().has(Health::camera_slow) && loop.health().has(Health::beyond_calibration);
  }));
  EXPECT_GT(loop.exchange.camera_fps.load(), 0);
  loop.camera.status = hal::GrabStatus::unplugged;
  loop.step(60);
  EXPECT_TRUE(loop.health().has(Health::camera_fault));
  EXPECT_FALSE(loop.health().has(Health::camera_slow));
  EXPECT_FALSE(loop.health().has(Health::beyond_calibration));
  EXPECT_EQ(loop.exchange.camera_fps.load(), 0);
}

// Each change of the light begins the wait anew. Before: the re-zero was never answered, and no
// command after it was taken.
TEST(CaptureLoop, LightThatGoesOnChangingPutsNoRezeroOffWithoutEnd) {
  SteppedLoop loop;
  loop.config.reference.timeout_frames = 30;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  ASSERT_TRUE(loop.submit(Rezero{true}));
  ASSERT_TRUE(loop.submit(SetReconstruction{}));
  const double limit_s = loop.config.reference.rezero_timeout_s(60, 60);
  const int frames = static_cast<int>(60 * limit_s) + 1;
  for (int i = 0; i < frames; ++i) {
    if (i % 5 == 0) loop.loop->tracker().exposure_changed();
    (void)loop.step();
  }
  const auto answers = loop.all<CommandDone>();
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[0].outcome, Outcome::refused_unsteady);
  EXPECT_TRUE(std::holds_alternative<SetReconstruction>(answers[1].command.what));
}

// Before: the first frame of a client that came hours later was still in contact.
TEST(CaptureLoop, ContactThatNobodyListenedToIsForgotten) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.scene.press_mm = 1;
  loop.step(10);
  ASSERT_TRUE(loop.frame->contact.in_contact);
  loop.exchange.wanted = Wanted{};
  loop.step(5);
  loop.camera.scene.press_mm = 0;
  loop.step(5);
  const std::size_t events = loop.all<ContactChanged>().size();
  loop.exchange.wanted = Wanted{.contact = true, .depth = true};
  ASSERT_TRUE(loop.until([&] { return loop.frame->has_depth; }, 2));
  EXPECT_FALSE(loop.frame->contact.in_contact);
  loop.step(5);
  EXPECT_EQ(loop.all<ContactChanged>().size(), events) << "nobody had heard of its begin";
}

TEST(CaptureLoop, EveryFrameReportsTheForceThatTheCalibrationKnows) {
  auto calibration = toy_calibration();
  auto model = std::make_shared<recon::Model>(*calibration->model);
  model->force = recon::ForceModel{
      .modulus_mpa = 0.1, .thickness_mm = 2, .pairs = 8, .from_n = 0.1, .to_n = 2};
  calibration->model = std::move(model);
  SteppedLoop loop;
  loop.begin(calibration);
  ASSERT_TRUE(loop.until_fresh());
  loop.step(3);
  ASSERT_TRUE(loop.frame->contact.force);
  EXPECT_EQ(loop.frame->contact.force->newtons, 0);
  EXPECT_NEAR(loop.frame->contact.force->uncertainty_n, 0.01, 1e-9);
  loop.camera.scene.press_mm = 0.5;
  loop.step(10);
  ASSERT_TRUE(loop.frame->contact.force);
  EXPECT_GT(loop.frame->contact.force->newtons, 0.05);
  EXPECT_GT(loop.frame->contact.force->uncertainty_n, 0.01);
  EXPECT_EQ(loop.frame->contact.force_absence, recon::ForceAbsence::none);
}

TEST(CaptureLoop, ARezeroOfACameraThatWentAwayIsGivenUp) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.scene.press_mm = 1;
  loop.step(10);
  ASSERT_TRUE(loop.submit(Rezero{true}));
  loop.step(4);
  loop.camera.status = hal::GrabStatus::unplugged;
  loop.step(2);
  const auto answers = loop.all<CommandDone>();
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_TRUE(std::holds_alternative<Rezero>(answers[0].command.what));
  EXPECT_EQ(answers[0].outcome, Outcome::camera_away);
  loop.camera.status = hal::GrabStatus::ok;
  ASSERT_TRUE(loop.until([&] { return loop.frame->has_depth; }));
  EXPECT_NEAR(loop.frame->contact.deepest_mm, 1, 0.05) << "an image with contact is no reference";
}

// Two seconds between two frames. Before: a second of silence was the camera's end, and no re-zero
// succeeded.
TEST(CaptureLoop, ARezeroWaitsForTheFramesOfASlowCamera) {
  SteppedLoop loop(0.5);
  loop.camera.slower = 0.05;  // a grab waits for a tenth of a second
  const auto next_frame = [&] {
    loop.camera.status = hal::GrabStatus::timeout;
    loop.step(19);
    loop.camera.status = hal::GrabStatus::ok;
    (void)loop.step();
  };
  loop.begin(toy_calibration());
  for (int i = 0; i < 60; ++i) next_frame();
  ASSERT_TRUE(loop.frame->has_depth && loop.frame->health.empty());
  ASSERT_TRUE(loop.submit(Rezero{true}));
  for (int i = 0; i < 60; ++i) next_frame();
  const auto answers = loop.all<CommandDone>();
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_TRUE(std::holds_alternative<Rezero>(answers[0].command.what));
  EXPECT_EQ(answers[0].outcome, Outcome::done);
}

TEST(CaptureLoop, MakesNoDepthThatNobodyListensTo) {
  SteppedLoop loop;
  loop.exchange.wanted = Wanted{};
  loop.begin(toy_calibration());
  loop.step(100);
  EXPECT_EQ(loop.exchange.state, State::serving);
  EXPECT_TRUE(loop.health().empty());
  loop.camera.scene.press_mm = 1;
  loop.step(20);
  EXPECT_TRUE(loop.all<ContactChanged>().empty());
  for (const StageStatistics& stage : loop.exchange.statistics.stages()) {
    EXPECT_NE(stage.stage, std::string("lut"));
  }
  // The light and the picture are checked all the same.
  loop.camera.scene = {};
  loop.step(20);
  loop.camera.scene.light = 0.98;
  loop.step(20);
  EXPECT_TRUE(loop.health().has(Health::light_drifted));
  loop.camera.scene = {};
  loop.camera.scene.press_mm = 1;
  loop.exchange.wanted = Wanted{.contact = true};
  loop.step(5);
  ASSERT_EQ(loop.all<ContactChanged>().size(), 1U);
  EXPECT_NEAR(loop.all<ContactChanged>()[0].contact.deepest_mm, 1, 0.05);
}

// Light changes during contact without a subscriber: active tiles count as contact.
TEST(CaptureLoop, TakesNoReferenceInContactThatNobodyHears) {
  SteppedLoop loop;
  loop.exchange.wanted = Wanted{};
  loop.begin(toy_calibration());
  loop.light->start();
  loop.step(100);
  ASSERT_EQ(loop.exchange.state, State::serving);
  // 3.4 % of the light: contact (2.5 %), but not if the frame before had no contact (4 %).
  loop.camera.scene.press_mm = 0.17;
  loop.step(20);
  hal::Light dim = loop.config.light;
  dim.brightness = 128;
  ASSERT_TRUE(loop.light->submit({SetLight{dim}}));
  ASSERT_TRUE(loop.until([&] { return loop.health().has(Health::light_unsettled); }, 100'000));
  loop.camera.scene.light = 0.5;
  ASSERT_TRUE(loop.until([&] { return !loop.health().has(Health::light_unsettled); }));
  EXPECT_TRUE(loop.health().has(Health::reference_stale));
}

// A refusal leaves the picture as it was; in contact nothing as good could be taken.
TEST(CaptureLoop, OnlyAChangeOfTheCameraThatItTakesMakesTheReferenceStale) {
  SteppedLoop loop;
  loop.camera.refuses_changes = true;
  loop.begin(toy_calibration());
  loop.light->start();
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.scene.press_mm = 1;
  loop.step(10);
  const auto change = [&] {
    EXPECT_TRUE(loop.light->submit({SetCamera{{.exposure_us = 5000, .gain = {}}}}));
    EXPECT_TRUE(loop.until([&] { return loop.health().has(Health::light_unsettled); }, 100'000));
    EXPECT_TRUE(loop.until([&] { return !loop.health().has(Health::light_unsettled); }));
  };
  change();
  EXPECT_TRUE(loop.health().empty());
  loop.camera.refuses_changes = false;
  change();
  EXPECT_TRUE(loop.health().has(Health::reference_stale));
}

TEST(CaptureLoop, AnotherCalibrationMeasuresAgainstTheReferenceThatStays) {
  SteppedLoop loop;
  loop.camera.scene.light = 0.9;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  ASSERT_TRUE(loop.use(toy_calibration()));
  loop.camera.scene.press_mm = 1;
  loop.step(6);
  EXPECT_NEAR(loop.frame->contact.deepest_mm, 1, 0.02);
}

TEST(CaptureLoop, NothingOfTheMapBeforeIsLeftInAnotherCalibrationsMap) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.scene.x_px = loop.camera.scene.y_px = 32;
  loop.camera.scene.press_mm = 1;
  loop.step(6);  // in each of the three buffers
  loop.camera.scene.press_mm = 0;
  ASSERT_TRUE(loop.use(toy_calibration({}, 128)));
  for (int i = 0; i < 6; ++i) {
    ASSERT_TRUE(loop.step());
    ASSERT_TRUE(loop.frame->has_depth);
    ASSERT_EQ(loop.frame->depth_um.size(), std::size_t{128} * 104);
    EXPECT_EQ(std::ranges::count(loop.frame->depth_um, 0), 128 * 104);
  }
}

TEST(CaptureLoop, EveryRezeroIsAnswered) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  ASSERT_TRUE(loop.submit(Rezero{}));
  loop.step(1);
  ASSERT_TRUE(loop.submit(Rezero{true}));
  loop.step(40);
  const auto answers = loop.all<CommandDone>();
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_FALSE(std::get<Rezero>(answers[0].command.what).force);
  EXPECT_EQ(answers[0].outcome, Outcome::done);
  EXPECT_TRUE(std::get<Rezero>(answers[1].command.what).force);
  EXPECT_EQ(answers[1].outcome, Outcome::done);
}

TEST(CaptureLoop, BeyondTheLutIsCountedInTheCalibrationsPixels) {
  SteppedLoop loop;
  loop.config.reconstruction.decimation = 4;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  // 94 grey levels where the LUT ends at 70: within 6.5 pixels of the middle, eight coarse ones.
  loop.camera.scene.press_mm = 3;
  loop.step(10);
  EXPECT_TRUE(loop.frame->health.has(Health::beyond_calibration));
}

TEST(CaptureLoop, LossesAreAConditionForASecond) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.status = hal::GrabStatus::damaged;
  loop.step(1);
  const std::int64_t lost_ns = loop.clock.now;
  loop.camera.status = hal::GrabStatus::ok;
  ASSERT_TRUE(loop.until([&] { return !loop.health().has(Health::frames_lost); }));
  EXPECT_NEAR(static_cast<double>(loop.clock.now - lost_ns), 1e9, 17e6);
}

}  // namespace
}  // namespace dtact::pipeline
// NOLINTEND(bugprone-unchecked-optional-access)
