#include "daemon/app/health_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <thread>

#include "daemon/app/status_reporter.hpp"

namespace dtact::app {
namespace {

using namespace std::chrono_literals;
using pipeline::Health;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::StartsWith;

pipeline::Status with(std::initializer_list<Health> health_flags) {
  pipeline::Status status;
  status.state = pipeline::State::serving;
  for (const Health health : health_flags) status.health.set(health);
  return status;
}

class HealthFlags : public testing::Test {
 protected:
  /// The texts of the lines a second later.
  std::vector<std::string> after(std::chrono::seconds pause, const pipeline::Status& status) {
    now_ += pause;
    std::vector<std::string> texts;
    for (const auto& line : log_.step(status, now_)) texts.push_back(line.text);
    return texts;
  }

  pipeline::HealthSet reported_ = with({Health::uncalibrated}).health;
  HealthLog log_{reported_};
  HealthLog::Time now_{1000s};
};

TEST_F(HealthFlags, BeginAndEndAreALineEach) {
  const auto lines = log_.step(with({Health::camera_fault}), now_);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].text, "camera_fault: The camera gives no usable frames.");
  EXPECT_EQ(lines[0].flag, "camera_fault");
  EXPECT_TRUE(lines[0].warning);
  EXPECT_THAT(after(1s, with({Health::camera_fault})), IsEmpty());
  EXPECT_THAT(after(100s, with({Health::camera_fault})), IsEmpty());
  EXPECT_THAT(after(1s, with({})), ElementsAre("camera_fault is over"));
  EXPECT_THAT(after(1s, with({})), IsEmpty());
}

TEST_F(HealthFlags, OneThatComesAndGoesIsReportedOnceAMinuteWithItsCount) {
  EXPECT_THAT(after(1s, with({Health::frames_lost})), ElementsAre(StartsWith("frames_lost: ")));
  EXPECT_THAT(after(1s, with({})), ElementsAre("frames_lost is over"));
  for (int i = 0; i < 10; ++i) {
    EXPECT_THAT(after(1s, with({Health::frames_lost})), IsEmpty());
    EXPECT_THAT(after(1s, with({})), IsEmpty());
  }
  EXPECT_THAT(after(38s, with({})), IsEmpty());
  EXPECT_THAT(after(1s, with({})),
              ElementsAre("frames_lost: The camera loses frames on their way to this machine: look "
                          "at the USB cable and hub. (came 10 times since it was last reported)"));
  EXPECT_THAT(after(100s, with({})), IsEmpty());
  EXPECT_THAT(after(1s, with({Health::frames_lost})),
              ElementsAre("frames_lost: The camera loses frames on their way to this machine: look "
                          "at the USB cable and hub."));
}

TEST_F(HealthFlags, OneStillThereAfterTheMinuteIsReported) {
  EXPECT_THAT(after(1s, with({Health::image_dark})), ElementsAre(StartsWith("image_dark: ")));
  EXPECT_THAT(after(1s, with({})), ElementsAre("image_dark is over"));
  EXPECT_THAT(after(1s, with({Health::image_dark})), IsEmpty());
  EXPECT_THAT(after(58s, with({Health::image_dark})), ElementsAre(StartsWith("image_dark: ")));
  EXPECT_THAT(after(1s, with({})), ElementsAre("image_dark is over"));
}

TEST_F(HealthFlags, WhatTheStartHasReportedIsNotReportedAgain) {
  EXPECT_THAT(after(1s, with({})), IsEmpty());
  EXPECT_THAT(after(1s, with({Health::uncalibrated})), IsEmpty());
  EXPECT_THAT(after(1s, with({})), ElementsAre("uncalibrated is over"));
  EXPECT_THAT(after(1s, with({Health::uncalibrated})), ElementsAre(StartsWith("uncalibrated: ")));
}

// What the start has reported was right before the first look, and comes much later.
TEST_F(HealthFlags, WhatTheStartHasReportedCountsForTheStart) {
  EXPECT_THAT(after(1s, with({})), IsEmpty());
  EXPECT_THAT(after(61s, with({})), IsEmpty());
  EXPECT_THAT(after(1s, with({Health::uncalibrated})), ElementsAre(StartsWith("uncalibrated: ")));
}

TEST_F(HealthFlags, TheUsualStepsOfAStartAreNoWarnings) {
  const auto lines = log_.step(with({Health::starting}), now_);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_FALSE(lines[0].warning);
}

TEST(StatusText, SaysStateRateAndHealth) {
  pipeline::Status status = with({});
  status.fps = 59.96;
  EXPECT_EQ(status_text(status, "", "listening on 127.0.0.1:7377"),
            "serving, 60 fps, healthy; listening on 127.0.0.1:7377");
  status = with({Health::camera_fault, Health::ring_fault});
  status.state = pipeline::State::camera_lost;
  EXPECT_EQ(status_text(status, "needs a restart: camera.fps", "listening on x"),
            "camera_lost, 0 fps, camera_fault, ring_fault; needs a restart: camera.fps; "
            "listening on x");
}

TEST(StatusReporter, LeavesNoWorkWhenItIsStoppedAsItsTimeComes) {
  boost::asio::io_context io(1);
  boost::asio::steady_timer sooner(io, 1ms);
  StatusReporter reporter(io, [] { return pipeline::Status{}; }, "", {});
  sooner.async_wait([&](const boost::system::error_code&) { reporter.stop(); });
  std::this_thread::sleep_for(1100ms);  // both are due
  io.run_for(10s);
  EXPECT_TRUE(io.stopped());
}

}  // namespace
}  // namespace dtact::app
