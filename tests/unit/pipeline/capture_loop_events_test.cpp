// Frames, events and answers report what the loop measured.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/pipeline/capture_loop.hpp"
#include "tests/fakes/stepped_loop.hpp"

// begin() of the fake sets the optionals.
// NOLINTBEGIN(bugprone-unchecked-optional-access)
namespace dtact::pipeline {
namespace {

using fakes::SteppedLoop;
using fakes::toy_calibration;

TEST(CaptureLoop, StampsAFrameWithTheWallTimeOfItsExposure) {
  SteppedLoop loop;
  loop.camera.delay_ns = 12'345'678;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  EXPECT_EQ(loop.frame->camera.timestamp_ns, loop.clock.now - 12'345'678);
  EXPECT_EQ(loop.frame->wall_ns, loop.frame->camera.timestamp_ns + fakes::FakeClock::kWallOffset);
}

// The light changes while an object is pressed in. Nothing is measured meanwhile.
TEST(CaptureLoop, WhatIsHeldWhileAReferenceIsTakenIsNotLost) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  loop.light->start();
  ASSERT_TRUE(loop.until_fresh());
  EXPECT_EQ(loop.frame->contact_absence, ContactAbsence::none);
  loop.camera.scene.press_mm = 1;
  loop.step(10);
  ASSERT_EQ(loop.all<ContactChanged>().size(), 1U);
  hal::Light dim = loop.config.light;
  dim.brightness = 128;
  ASSERT_TRUE(loop.light->submit({SetLight{dim}}));
  ASSERT_TRUE(loop.until([&] { return !loop.frame->has_depth; }, 100'000));
  loop.camera.scene.light = 0.5;
  EXPECT_EQ(loop.frame->contact_absence, ContactAbsence::referencing);
  EXPECT_FALSE(loop.frame->contact.in_contact);
  EXPECT_EQ(loop.frame->contact.area_mm2, 0);
  ASSERT_TRUE(loop.until([&] { return loop.frame->has_depth; }));
  EXPECT_EQ(loop.frame->contact_absence, ContactAbsence::none);
  EXPECT_TRUE(loop.frame->contact.in_contact);
  loop.step(10);
  EXPECT_EQ(loop.all<ContactChanged>().size(), 1U) << "made, and never lost";
}

TEST(CaptureLoop, SaysWhyContactIsNotMeasured) {
  SteppedLoop loop;
  loop.exchange.wanted = Wanted{.contact = true, .depth = true, .luma = true};
  loop.begin(nullptr);
  loop.step(3);
  EXPECT_EQ(loop.frame->contact_absence, ContactAbsence::uncalibrated);
  EXPECT_EQ(loop.frame->calibration, std::nullopt);
  SteppedLoop unheard;
  unheard.exchange.wanted = Wanted{.luma = true};
  unheard.begin(toy_calibration());
  unheard.step(1);
  EXPECT_EQ(unheard.frame->contact_absence, ContactAbsence::referencing);
  unheard.step(100);
  EXPECT_EQ(unheard.frame->contact_absence, ContactAbsence::unasked);
}

TEST(CaptureLoop, AFrameNamesTheCalibrationThatMeasuredIt) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  EXPECT_EQ(loop.frame->calibration, 0U) << "the one at start";
  ASSERT_TRUE(loop.use(toy_calibration(), 9));
  const std::uint64_t before = loop.frame->camera.sequence;
  const std::int64_t asked_ns = loop.clock.now;
  ASSERT_TRUE(loop.step());
  EXPECT_EQ(loop.frame->calibration, 9U);
  const auto answers = loop.all<CommandDone>();
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_EQ(answers[0].at.sequence, before) << "the last frame of the other";
  EXPECT_EQ(answers[0].at.monotonic_ns, asked_ns);
  EXPECT_EQ(answers[0].at.wall_ns, asked_ns + fakes::FakeClock::kWallOffset);
}

TEST(CaptureLoop, EveryEventKnowsItsFrameAndItsMoment) {
  SteppedLoop loop;
  loop.camera.sequence = 100;
  loop.begin(toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  const auto references = loop.all<ReferenceTaken>();
  ASSERT_EQ(references.size(), 1U);
  EXPECT_GT(references[0].at.sequence, 100U);
  EXPECT_EQ(references[0].at.wall_ns,
            references[0].at.monotonic_ns + fakes::FakeClock::kWallOffset);
  const auto states = loop.all<StateChanged>();
  ASSERT_GE(states.size(), 2U);
  EXPECT_EQ(states[0].at.sequence, 100U);
  EXPECT_EQ(states.back().at.sequence, references[0].at.sequence) << "serving from then on";
  EXPECT_EQ(states.back().at.wall_ns,
            states.back().at.monotonic_ns + fakes::FakeClock::kWallOffset);
  loop.camera.status = hal::GrabStatus::unplugged;
  const std::uint64_t last = loop.frame->camera.sequence;
  loop.step(3);
  EXPECT_EQ(loop.all<StateChanged>().back().state, State::camera_lost);
  EXPECT_EQ(loop.all<StateChanged>().back().at.sequence, last);
}

TEST(CaptureLoop, AFrameKnowsSinceWhenItsLightShows) {
  SteppedLoop loop;  // two frames' delay; stamped at the exposure's beginning
  loop.begin(toy_calibration());
  loop.step(1);
  EXPECT_EQ(loop.frame->light_since_ns, std::nullopt);
  const std::int64_t shown_ns = loop.clock.now;
  loop.light->start();
  loop.step(1);
  const auto period_ns = static_cast<std::int64_t>(1e9 / 60);
  ASSERT_TRUE(loop.frame->light_since_ns);
  EXPECT_NEAR(static_cast<double>(*loop.frame->light_since_ns),
              static_cast<double>(shown_ns + 2 * period_ns), 10);
  EXPECT_EQ(loop.light->light_since_ns(), loop.frame->light_since_ns);
}

// A stamp at the frame's end is a period after the exposure that shows the light.
TEST(CaptureLoop, SinceWhenALightShowsIsInTheFramesOwnTimestamps) {
  SteppedLoop loop;
  loop.camera.meaning = hal::TimestampMeaning::end_of_frame;
  loop.begin(toy_calibration());
  const std::int64_t shown_ns = loop.clock.now;
  loop.light->start();
  loop.step(2);
  const auto period_ns = static_cast<std::int64_t>(1e9 / 60);
  ASSERT_TRUE(loop.frame->light_since_ns);
  EXPECT_NEAR(static_cast<double>(*loop.frame->light_since_ns),
              static_cast<double>(shown_ns + 3 * period_ns), 10);
  EXPECT_EQ(loop.light->light_since_ns(), loop.frame->light_since_ns);
}

// Every pixel: the corners alone would not show a row that was copied in part.
TEST(CaptureLoop, PublishesTheWholePictureWhenItIsWanted) {
  SteppedLoop loop;
  loop.exchange.wanted = Wanted{.luma = true};
  loop.camera.scene = {.tilt = 0.4, .press_mm = 1, .x_px = 120, .y_px = 30};
  loop.begin(nullptr);
  ASSERT_TRUE(loop.step());
  ASSERT_TRUE(loop.frame->has_luma);
  EXPECT_EQ(loop.frame->luma_width, fakes::kToyWidth);
  EXPECT_EQ(loop.frame->luma_height, fakes::kToyHeight);
  std::vector<std::uint8_t> expected(std::size_t{fakes::kToyWidth} * fakes::kToyHeight);
  fakes::toy_paint(loop.camera.scene, loop.frame->camera.sequence, expected.data());
  EXPECT_EQ(loop.frame->luma, expected);
}

TEST(CaptureLoop, PublishesTheCamerasJpegWhenItIsWanted) {
  SteppedLoop loop;
  loop.exchange.wanted = Wanted{};
  loop.camera.jpeg = {0xff, 0xd8, 1, 0xff, 0xd9};
  loop.begin(toy_calibration());
  EXPECT_FALSE(loop.step()) << "nobody wants it";
  loop.exchange.wanted = Wanted{.jpeg = true};
  ASSERT_TRUE(loop.step());
  EXPECT_TRUE(loop.frame->has_jpeg);
  EXPECT_EQ(loop.frame->jpeg, loop.camera.jpeg);
  EXPECT_EQ(loop.frame->jpeg_width, fakes::kToyWidth);
  EXPECT_EQ(loop.frame->jpeg_height, fakes::kToyHeight);
  EXPECT_FALSE(loop.frame->has_luma);
  loop.camera.jpeg.resize(101);  // there is room for 100
  ASSERT_TRUE(loop.step());
  EXPECT_FALSE(loop.frame->has_jpeg);
  loop.camera.jpeg.clear();
  ASSERT_TRUE(loop.step());
  EXPECT_FALSE(loop.frame->has_jpeg);
}

TEST(CaptureLoop, CopiesTheReferenceImageOut) {
  SteppedLoop loop;
  loop.begin(toy_calibration());
  const auto made = std::make_shared<ReferenceCopy>();
  ReferenceCopy& copy = *made;
  copy.image_q8.resize(std::size_t{fakes::kToyWidth} * fakes::kToyHeight);
  ASSERT_TRUE(loop.submit(CopyReference{made}));
  loop.step(1);
  ASSERT_EQ(loop.all<CommandDone>().size(), 1U);
  EXPECT_EQ(loop.all<CommandDone>()[0].outcome, Outcome::no_reference);
  ASSERT_TRUE(loop.until_fresh());
  loop.step(5);
  ASSERT_TRUE(loop.submit(CopyReference{made}));
  loop.step(1);
  ASSERT_EQ(loop.all<CommandDone>().size(), 2U);
  EXPECT_EQ(loop.all<CommandDone>()[1].outcome, Outcome::done);
  EXPECT_EQ(copy.sequence, loop.all<ReferenceTaken>().at(0).at.sequence);
  EXPECT_EQ(copy.light, loop.config.light);
  // The toy has no contact: the reference is the image itself.
  std::vector<std::uint8_t> pixels(copy.image_q8.size() + hal::kLumaPadding);
  fakes::toy_paint({}, 1, pixels.data());
  const std::size_t centre = copy.image_q8.size() / 2 + fakes::kToyWidth / 2;
  EXPECT_NEAR(copy.image_q8[centre] / 256.0, pixels[centre], 2);

  SteppedLoop uncalibrated;
  uncalibrated.begin(nullptr);
  ASSERT_TRUE(uncalibrated.submit(CopyReference{made}));
  uncalibrated.step(1);
  ASSERT_EQ(uncalibrated.all<CommandDone>().size(), 1U);
  EXPECT_EQ(uncalibrated.all<CommandDone>()[0].outcome, Outcome::uncalibrated);
}

}  // namespace
}  // namespace dtact::pipeline
// NOLINTEND(bugprone-unchecked-optional-access)
