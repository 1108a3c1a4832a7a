#include "daemon/pipeline/reference/light_follower.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kFrameNs = 100'000'000;  // 10 frames a second
constexpr int kSecond = 10;
constexpr int kMinute = 600;

/// The follower with light as a share of the reference's, applied at once.
class LightFollowerTest : public ::testing::Test {
 protected:
  void no_contact(double light, int frames = 1) { see(light, LightSeen::From::all, frames); }
  void in_contact(double light, int frames) { see(light, LightSeen::From::nothing, frames); }
  /// Changes evenly from the present light.
  void drift(double to, int frames, LightSeen::From how = LightSeen::From::all) {
    const double from = light_;
    for (int i = 1; i <= frames; ++i) see(from + (to - from) * i / frames, how, 1);
  }

  LightFollower follower_{DriftRules{.limit_percent = 2, .percent_per_minute = 2}};

  void see(double light, LightSeen::From from, int frames) {
    for (int i = 0; i < frames; ++i) {
      LightSeen seen;
      if (from != LightSeen::From::nothing) seen = {from, light / follower_.factor() - 1};
      now_ns_ += kFrameNs;
      (void)follower_.look(seen, now_ns_);
    }
    light_ = light;
  }

 private:
  double light_ = 1;
  std::int64_t now_ns_ = 0;
};

TEST_F(LightFollowerTest, StaysAtOneWhileTheLightDoes) {
  no_contact(1, kMinute);
  EXPECT_EQ(follower_.factor(), 1);
  EXPECT_FALSE(follower_.drifted());
}

TEST_F(LightFollowerTest, FollowsSlowDriftToWithinASixteenthOfALevel) {
  drift(0.99, kMinute);
  EXPECT_NEAR(follower_.factor(), 0.99, 0.0005);
  EXPECT_FALSE(follower_.drifted());
  drift(1.005, 3 * kMinute / 2);
  EXPECT_NEAR(follower_.factor(), 1.005, 0.0005);
}

TEST_F(LightFollowerTest, EndsAtTheLimitAndReports) {
  drift(0.97, 3 * kMinute);
  EXPECT_NEAR(follower_.factor(), 0.98, 0.0004);
  EXPECT_NEAR(follower_.left(), -0.0102, 0.0004);
  EXPECT_TRUE(follower_.drifted());
  drift(0.99, 2 * kMinute);
  EXPECT_NEAR(follower_.factor(), 0.99, 0.0005);
  EXPECT_FALSE(follower_.drifted());
}

TEST_F(LightFollowerTest, AStepIsReportedAndNeverFollowed) {
  no_contact(1, kMinute);
  no_contact(0.995, 2);
  EXPECT_FALSE(follower_.drifted()) << "a single odd frame says nothing";
  no_contact(0.995);
  EXPECT_TRUE(follower_.drifted());
  no_contact(0.995, 10 * kMinute);
  EXPECT_EQ(follower_.factor(), 1);
  EXPECT_NEAR(follower_.left(), -0.005, 1e-9);
  no_contact(1, 3);
  EXPECT_FALSE(follower_.drifted());
}

TEST_F(LightFollowerTest, DriftFasterThanTheRateIsReported) {
  no_contact(1, kMinute);
  drift(0.96, kMinute);
  EXPECT_GT(follower_.factor(), 0.98);
  EXPECT_TRUE(follower_.drifted());
}

TEST_F(LightFollowerTest, CatchesUpAfterALongPress) {
  no_contact(1, kMinute);
  drift(0.99, kMinute, LightSeen::From::nothing);
  EXPECT_EQ(follower_.factor(), 1);
  no_contact(0.99, kSecond - 1);
  EXPECT_EQ(follower_.factor(), 1) << "waits a second";
  no_contact(0.99, 2);
  EXPECT_NEAR(follower_.factor(), 0.99, 0.0001);
}

TEST_F(LightFollowerTest, StatesHowFarTheLightMayHaveMovedOutOfSight) {
  no_contact(1, kMinute);
  EXPECT_EQ(follower_.unseen(), 0);
  in_contact(1, 3 * kSecond);
  EXPECT_EQ(follower_.unseen(), 0) << "between two looks beside a press";
  in_contact(1, 27 * kSecond);
  EXPECT_NEAR(follower_.unseen(), 0.005, 1e-9) << "half of 2 % a minute";
  in_contact(1, 5 * kMinute);
  EXPECT_NEAR(follower_.unseen(), 0.01, 1e-9) << "half of the limit";
  no_contact(1);
  EXPECT_EQ(follower_.unseen(), 0);
}

TEST_F(LightFollowerTest, FollowsBesideAPressWhatTheRestShows) {
  no_contact(1, kMinute);
  drift(0.994, 2 * kMinute, LightSeen::From::quiet);
  EXPECT_NEAR(follower_.factor(), 0.994, 0.0005);
  EXPECT_FALSE(follower_.drifted());
}

TEST_F(LightFollowerTest, WaitsASecondWhenTheLightIsSeenAnotherWay) {
  no_contact(1, kMinute);
  see(0.999, LightSeen::From::quiet, kSecond);
  EXPECT_EQ(follower_.factor(), 1);
  see(0.999, LightSeen::From::quiet, 3);  // 1.3 s at 2 % a minute
  EXPECT_NEAR(follower_.factor(), 0.99957, 0.00001);
}

TEST_F(LightFollowerTest, AStepThatComesWithAPressIsReportedAndNotFollowed) {
  no_contact(1, kMinute);
  see(0.99, LightSeen::From::quiet, kMinute);
  EXPECT_EQ(follower_.factor(), 1);
  EXPECT_NEAR(follower_.left(), -0.01, 1e-9);
  EXPECT_TRUE(follower_.drifted());
}

TEST_F(LightFollowerTest, AShortPressAllowsNoStep) {
  no_contact(1, kMinute);
  in_contact(1, 2 * kSecond);
  no_contact(0.99, 10 * kMinute);
  EXPECT_EQ(follower_.factor(), 1);
  EXPECT_TRUE(follower_.drifted());
}

TEST_F(LightFollowerTest, WhatWasNotFollowedIsNotAllowedForLater) {
  no_contact(1, kMinute);
  no_contact(0.99, kSecond);
  for (int i = 0; i < 60; ++i) {  // a flat press that moves a little
    in_contact(0.99, 9);
    no_contact(0.99);
  }
  no_contact(0.99, kMinute);
  EXPECT_EQ(follower_.factor(), 1);
}

TEST_F(LightFollowerTest, ANewReferenceBeginsAnew) {
  drift(0.99, kMinute);
  no_contact(0.95, kSecond);
  follower_.restart();
  EXPECT_EQ(follower_.factor(), 1);
  EXPECT_EQ(follower_.left(), 0);
  EXPECT_FALSE(follower_.drifted());
}

TEST_F(LightFollowerTest, OnlyReportsWhereNobodyAppliesIt) {
  follower_.restart(false);
  drift(0.99, kMinute);
  EXPECT_EQ(follower_.factor(), 1);
  EXPECT_TRUE(follower_.drifted());
}

TEST_F(LightFollowerTest, ALimitOfZeroOnlyReports) {
  follower_ = LightFollower(DriftRules{.limit_percent = 0, .percent_per_minute = 2});
  drift(0.99, kMinute);
  EXPECT_EQ(follower_.factor(), 1);
  EXPECT_TRUE(follower_.drifted());
  in_contact(1, 5 * kMinute);
  EXPECT_NEAR(follower_.unseen(), 0.01, 1e-9) << "no less than where it is followed";
}

}  // namespace
}  // namespace dtact::pipeline
