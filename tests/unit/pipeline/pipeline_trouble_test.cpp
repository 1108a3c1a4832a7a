// The whole pipeline under faults, delays and refusals: what it reports and how it stops.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>

#include "tests/unit/pipeline/whole_pipeline.hpp"

namespace dtact::pipeline {
namespace {

using Mode = fakes::FakeCamera::Mode;

TEST_F(PipelineTest, UnpluggedAndBack) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.mode = Mode::unplugged;
  ASSERT_TRUE(until_state(State::camera_lost));
  EXPECT_TRUE(pipeline->status().health.has(Health::camera_fault));
  EXPECT_EQ(pipeline->status().camera_report.fix, "plug the fake camera in");
  EXPECT_EQ(ask(Rezero{}).outcome, Outcome::camera_away);
  camera.mode = Mode::streaming;
  ASSERT_TRUE(until_fresh());
  ASSERT_TRUE(until_state(State::serving));
  ASSERT_TRUE(until([&] { return all<ReferenceTaken>().size() == 2U; }));
}

TEST_F(PipelineTest, ASilentCameraIsTroubleAndAnswersStillCome) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.mode = Mode::silent;
  ASSERT_TRUE(until([&] { return pipeline->status().health.has(Health::camera_fault); }));
  EXPECT_EQ(pipeline->status().state, State::serving);
  EXPECT_EQ(ask(Rezero{}).outcome, Outcome::camera_away);
  camera.mode = Mode::streaming;
  ASSERT_TRUE(until_fresh());
}

TEST_F(PipelineTest, LostAndDamagedFramesAreAConditionForASecond) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.lose = 3;
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.health.has(Health::frames_lost); }));
  ASSERT_TRUE(until_fresh());
  camera.damage = 1;
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.health.has(Health::frames_lost); }));
}

TEST_F(PipelineTest, DeeperThanTheLutIsACondition) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.press(3);  // the LUT ends at 70 grey levels, 2.2 mm
  ASSERT_TRUE(
      until_frame([](const DepthFrame& f) { return f.health.has(Health::beyond_calibration); }));
  EXPECT_LT(frame->contact.deepest_mm, 2.3);
}

TEST_F(PipelineTest, AFullEventQueueLosesNoAnswerAndNoState) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  // Events stay unread while contact comes and goes more often than the queue is long, 64.
  const auto shown = [&](bool in_contact) {
    for (int i = 0; i < 5000; ++i) {
      const DepthFrame* newest = pipeline->latest();
      if (newest != nullptr && newest->contact.in_contact == in_contact) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  };
  for (int i = 0; i <= 80; ++i) {
    camera.press(i % 2 == 0 ? 1 : 0);
    ASSERT_TRUE(shown(i % 2 == 0)) << i;
  }
  ASSERT_TRUE(pipeline->submit({Rezero{}}));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  std::size_t waiting = 0;
  for (; auto event = pipeline->next_event(); ++waiting) events.push_back(std::move(*event));
  EXPECT_GE(waiting, 64U) << "the queue was never full";
  ASSERT_TRUE(until([&] {
    const auto answers = all<CommandDone>();
    return !answers.empty() && std::holds_alternative<Rezero>(answers.back().command.what);
  }));
  ASSERT_TRUE(until([&] { return all<ContactChanged>().back().in_contact; }));
  const auto changes = all<ContactChanged>();
  for (std::size_t i = 1; i < changes.size(); ++i) {
    EXPECT_NE(changes[i].in_contact, changes[i - 1].in_contact) << i;
  }
}

TEST_F(PipelineTest, TheNewestFrameWinsAndTheOthersAreCounted) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  const std::uint64_t before = pipeline->status().skipped;
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  const DepthFrame* newest = pipeline->latest();
  ASSERT_NE(newest, nullptr);
  const std::uint64_t number = newest->number;
  const std::uint64_t sequence = newest->camera.sequence;
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  newest = pipeline->latest();
  ASSERT_NE(newest, nullptr);
  EXPECT_GT(pipeline->status().skipped, before);
  EXPECT_GT(newest->number, number + 1);
  EXPECT_EQ(newest->number - number, newest->camera.sequence - sequence) << "the camera lost none";
}

TEST_F(PipelineTest, WithoutSubscribersNothingIsPublishedButContactIsReported) {
  build(fakes::toy_calibration());
  pipeline->want({.contact = true});
  pipeline->start();
  ASSERT_TRUE(until([&] { return !all<ReferenceTaken>().empty(); }));
  camera.press(1);
  ASSERT_TRUE(until([&] { return !all<ContactChanged>().empty(); }));
  EXPECT_EQ(frame, nullptr);
  EXPECT_EQ(pipeline->status().frames, 0U);
}

TEST_F(PipelineTest, StatusHasStagesAndRate) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  ASSERT_TRUE(until([&] { return pipeline->status().fps > 0; }));
  const Status status = pipeline->status();
  ASSERT_EQ(status.stages.size(), 8U);
  EXPECT_EQ(status.stages[3].stage, "smooth");
  // There is no contact, so nothing is smoothed; the check of the frame takes its time anyway.
  EXPECT_EQ(status.stages[1].stage, "activity");
  EXPECT_GT(status.stages[1].p50_us, 0);
  EXPECT_EQ(status.stages[7].stage, "total");
  EXPECT_GT(status.stages[7].p50_us, 0);
  EXPECT_EQ(status.camera.identity, "fake camera");
  EXPECT_EQ(status.ring.identity, "fake ring");
  EXPECT_TRUE(status.realtime.empty());
  EXPECT_GT(status.frames, 0U);
}

TEST_F(PipelineTest, RefusedRealTimeIsSaidAndSurvived) {
  config.fifo_priority = 1;
  config.cpu = 1000;  // no machine has it
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth; }));
  const Status status = pipeline->status();
  ASSERT_FALSE(status.realtime.empty());
  EXPECT_NE(status.realtime[0].find("CPU 1000"), std::string::npos);
  // Whether FIFO is granted depends on the user of the test; the flag follows the sentence.
  EXPECT_EQ(status.health.has(Health::not_realtime), status.realtime.size() == 2);
}

TEST_F(PipelineTest, StopsWhileTheCameraIsSilent) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.mode = Mode::silent;
  ASSERT_TRUE(until([&] { return pipeline->status().health.has(Health::camera_fault); }));
  const auto began = std::chrono::steady_clock::now();
  pipeline->stop();
  // 0.1 s by design; the margin is for a busy machine.
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(5));
  EXPECT_EQ(camera.lent, 0);  // the last frame was released
}

// The camera's call or the disk may take longer than a service manager waits, which then kills.
TEST_F(PipelineTest, TheRingIsDarkBeforeACallOfTheCameraComesBack) {
  std::atomic<bool> stopping{false};
  std::atomic<bool> blocked{false};
  std::atomic<bool> dark{false};
  camera.on_grab = [&](std::uint64_t) {
    if (!stopping) return;
    blocked = true;
    for (int i = 0; i < 1000 && !ring.released; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    dark = ring.released.load();
  };
  start(fakes::toy_calibration());
  EXPECT_TRUE(until_fresh());
  stopping = true;
  EXPECT_TRUE(until([&] { return blocked.load(); }));
  pipeline->stop();
  EXPECT_TRUE(dark);
  EXPECT_EQ(pipeline->status().ring.identity, "fake ring");
}

TEST_F(PipelineTest, StopsWithoutHavingStarted) {
  build(fakes::toy_calibration());
  pipeline->stop();
  EXPECT_EQ(pipeline->latest(), nullptr);
  EXPECT_FALSE(pipeline->next_event());
}

TEST_F(PipelineTest, ACameraThatDoesNotStartIsAnError) {
  camera.refuse_start = true;
  build(fakes::toy_calibration());
  EXPECT_THROW(pipeline->start(), std::runtime_error);
}

TEST_F(PipelineTest, RefusesACameraItCannotUse) {
  camera.info.width = 60;
  EXPECT_THROW(build(nullptr), std::invalid_argument);
  camera.info.width = 160;
  camera.info.fps = 0;
  EXPECT_THROW(build(nullptr), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::pipeline
