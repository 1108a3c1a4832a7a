#include "clients/perceive/pose/tracker.hpp"

#include <gtest/gtest.h>

#include <array>

#include "tests/unit/perceive/balls.hpp"

namespace dtact::perceive {
namespace {

using namespace test;
using Eigen::Vector3d;
using State = Tracker::State;

/// Follows `frames` frames that move to `end_mm` and `degrees` about `axis`; the error at the end.
Error follow(Tracker& tracker, const Vector3d& end_mm, const Vector3d& axis, double degrees,
             int frames, double noise_um) {
  Error error;
  for (int i = 0; i <= frames; ++i) {
    const double part = static_cast<double>(i) / frames;
    const Motion truth = moved(part * end_mm, axis, part * degrees);
    const Frame frame(bumps(), truth, noise_um, static_cast<unsigned>(i));
    const auto& pose = tracker.follow(frame.view(), 100 + static_cast<unsigned>(i));
    EXPECT_EQ(pose.state, i == 0 ? State::started : State::tracked) << i;
    EXPECT_EQ(pose.since, 100U);
    error = error_of(pose.alignment, truth);
  }
  return error;
}

/// A twist about the surface's normal in the apex, then by `angle` about an axis at a finger's
/// centre.
Motion round_the_centre(double radius_mm, const Vector3d& axis, double angle, double twist_deg) {
  const Vector3d centre(0, 0, -1e-3 * radius_mm);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, axis).toRotationMatrix() *
                               moved({0, 0, 0}, Vector3d::UnitZ(), twist_deg).linear();
  return Eigen::Translation3d(centre - turn * centre) * Motion(turn);
}

TEST(Tracker, SlidesFourMillimetresPartlyOutOfView) {
  Tracker tracker;
  const Error error = follow(tracker, {3, 2.6, 0}, Vector3d::UnitZ(), 0, 40, 5);
  EXPECT_LT(error.um, 40);
  EXPECT_LT(error.degrees, 1.0);
}

TEST(Tracker, TwistsByThirtyDegrees) {
  Tracker tracker;
  const Error error = follow(tracker, {0, 0, 0}, Vector3d::UnitZ(), 30, 30, 5);
  EXPECT_LT(error.um, 30);
  EXPECT_LT(error.degrees, 0.8);
}

TEST(Tracker, RollsAndPressesDeeper) {
  Tracker tracker;
  const Error error = follow(tracker, {0, 0, -0.2}, Vector3d::UnitX(), 8, 30, 5);
  EXPECT_LT(error.um, 30);
  EXPECT_LT(error.degrees, 0.8);
}

// Round the finger at the same depth: three millimetres and a twist.
TEST(Tracker, SlidesRoundAFinger) {
  for (const recon::Surface& surface : curved()) {
    const double radius_mm = surface.radius_mm;
    const double axis_deg = surface.axis_deg * M_PI / 180;
    const Vector3d axis(std::cos(axis_deg), std::sin(axis_deg), 0);
    Tracker tracker;
    Error error;
    constexpr int kFrames = 40;
    for (int i = 0; i <= kFrames; ++i) {
      const double part = static_cast<double>(i) / kFrames;
      const Motion truth = round_the_centre(radius_mm, axis, part * 3 / radius_mm, part * 15);
      const Frame frame(bumps(), truth, 5, static_cast<unsigned>(i), surface);
      const auto& pose = tracker.follow(frame.view(), 100 + static_cast<unsigned>(i));
      EXPECT_EQ(pose.state, i == 0 ? State::started : State::tracked) << i;
      error = error_of(pose.alignment, truth);
    }
    EXPECT_LT(error.um, 30);
    EXPECT_LT(error.degrees, 0.8);
  }
}

TEST(Tracker, StandsStillWithoutDrifting) {
  Tracker tracker;
  const Error error = follow(tracker, {0, 0, 0}, Vector3d::UnitZ(), 0, 60, 10);
  EXPECT_LT(error.um, 6);
  EXPECT_LT(error.degrees, 0.3);
}

// A daemon with resolution "auto" does this: full, a quarter and a half in turn.
TEST(Tracker, FollowsThroughChangesOfResolution) {
  Tracker tracker;
  for (unsigned i = 0; i <= 40; ++i) {
    const Motion truth = moved({0.05 * i, 0, 0}, Vector3d::UnitZ(), 0.3 * i);
    const Frame fine({{{{-0.5, -0.4, 1.8}, 2}, {{0.5, 0.3, 2.3}, 2.5}}}, truth, 5, i);
    const int times = std::array{1, 4, 2}.at(i / 5 % 3);
    const CoarseFrame coarse(fine, times);
    const auto& pose = tracker.follow(times == 1 ? fine.view() : coarse.view(), 100 + i);
    EXPECT_EQ(pose.state, i == 0 ? State::started : State::tracked) << i;
    // A quarter's pixels are 0.2 mm.
    EXPECT_LT(error_of(pose.alignment, truth).um, times == 4 ? 40 : 20) << i;
  }
}

// A contact of 1.5 mm²: 600 pixels at full resolution, fewer than 40 at a quarter.
TEST(Tracker, FollowsASmallTipAtAQuarterOfTheResolution) {
  Tracker tracker;
  for (unsigned i = 0; i <= 20; ++i) {
    const Motion truth = moved({0.02 * i, 0, 0});
    const Frame fine({{{{0, 0, 1.8}, 2}}}, truth, 2, i);
    const CoarseFrame coarse(fine, 4);
    const auto& pose = tracker.follow(coarse.view(), 100 + i);
    EXPECT_EQ(pose.state, i == 0 ? State::started : State::tracked) << i;
    EXPECT_LT((pose.alignment.motion.translation() - truth.translation()).norm(), 6e-5) << i;
  }
}

// A plate over all of the map shows no edge. It is pushed to the right until its left edge is in
// view: the distance before that stays unknown however well the edge is followed later.
TEST(Tracker, WhatWasNotSeenOnTheWayStaysReported) {
  Tracker tracker;
  for (unsigned i = 0; i <= 60; ++i) {
    const double edge_mm = -5.5 + 0.1 * i;
    const Frame frame(
        [&](const SurfacePoint& at) {
          const double beside = edge_mm - 1e3 * at.point[0];
          return 0.4 * (beside > 0 ? std::exp(-beside / 0.15) : 1);
        },
        2, i);
    const auto& pose = tracker.follow(frame.view(), 100 + i);
    ASSERT_EQ(pose.state, i == 0 ? State::started : State::tracked) << i;
    double along_x = 0;
    for (const Twist& one : pose.unobservable) along_x += one[3] * one[3];
    EXPECT_GT(along_x, 0.8) << i;
  }
}

// In the first frames the contact is half a millimetre wide and the noise a fifteenth of its depth.
// With these seeds of 200 the ball turned by more than half a degree where a direction was too
// easily taken as observed; one more seed is added.
TEST(Tracker, ABallThatIsPressedInIsNotTurnedByNoise) {
  for (const unsigned seed : {0U, 101U, 118U, 122U}) {
    Tracker tracker;
    std::mt19937 random(seed + 7);
    std::uniform_int_distribution gap(1, 4);
    double turned = 0;
    for (int i = 0; i < 120; i += gap(random)) {
      const double depth_mm = std::min(1.0, -0.3 + 1.3 * i / 60);
      constexpr double kPressed = 0.02;
      if (depth_mm < kPressed) continue;
      const double x_mm = 0.5 + std::max(0, i - 60) / 60.0;
      const Frame frame({{{{x_mm, -0.5, 4 - depth_mm}, 4}}}, Motion::Identity(), 4,
                        seed * 1000 + static_cast<unsigned>(i));
      const auto& pose = tracker.follow(frame.view(), 100 + static_cast<unsigned>(i));
      EXPECT_NE(pose.state, State::lost) << seed << ", " << i;
      turned = std::max(turned, Eigen::AngleAxisd(pose.alignment.motion.linear()).angle());
    }
    EXPECT_LT(turned * 180 / M_PI, 0.1) << seed;
  }
}

// The daemon states 50 µm for an old calibration, mostly from bias and blur. A ball of 4 mm,
// pressed in by 0.1 mm, is deeper than 30 µm over 2π · 4 mm · 0.07 mm.
TEST(Tracker, FollowsALightPressOfAnUncertainCalibration) {
  Tracker tracker;
  for (unsigned i = 0; i <= 20; ++i) {
    const Motion truth = moved({0.02 * i, 0, 0});
    const Frame frame({{{{0, 0, 3.9}, 4}}}, truth, 5, i);
    const ContactView view = frame.view(50);
    EXPECT_NEAR(1e6 * view.area(), 1.76, 0.18) << i;
    const auto& pose = tracker.follow(view, 100 + i);
    EXPECT_EQ(pose.state, i == 0 ? State::started : State::tracked) << i;
    EXPECT_LT((pose.alignment.motion.translation() - truth.translation()).norm(), 6e-5) << i;
  }
}

// A ball of 4 mm in contact to 0.9 of Hertz's radius; the gel around it follows over 0.3 mm. Much
// of the first contact is this shoulder, which has nothing below it later; its area doubles too
// late.
TEST(Tracker, ABallThatIsPressedInOutgrowsTheShouldersOfItsFirstTouch) {
  Tracker tracker;
  for (unsigned i = 0; i <= 30; ++i) {
    const double depth_mm = 0.14 + 0.022 * i;
    const Frame frame(
        [&](const SurfacePoint& at) {
          constexpr double kRadiusMm = 4;
          const double edge_mm = std::sqrt(0.8 * kRadiusMm * depth_mm);
          const double from_mm = 1e3 * std::hypot(at.point[0], at.point[1]);
          const double contact_depth_mm = std::min(from_mm, edge_mm);
          return (depth_mm - contact_depth_mm * contact_depth_mm / (2 * kRadiusMm)) *
                 std::exp((contact_depth_mm - from_mm) / 0.3);
        },
        5, i);
    const auto& pose = tracker.follow(frame.view(), 100 + i);
    EXPECT_EQ(pose.state, i == 0 ? State::started : State::tracked) << i;
    EXPECT_NEAR(1e3 * pose.alignment.motion.translation().z(), 0.14 - depth_mm, 0.15) << i;
  }
}

// 10 µm, which is more than a reference map has.
TEST(Tracker, NoiseIsNoContactHoweverUncertainTheCalibration) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Frame frame(Balls{}, Motion::Identity(), 10, seed);
    EXPECT_LT(frame.view(118).area(), kMinArea / 2) << seed;
  }
}

TEST(Tracker, AJumpIsALossAndIsFoundAgain) {
  Tracker tracker;
  const Frame first(bumps(), Motion::Identity());
  (void)tracker.follow(first.view(), 1);
  const Motion away = moved({1.5, -1.0, 0}, Vector3d::UnitZ(), 12);
  const Frame jumped(bumps(), away);
  const auto lost = tracker.follow(jumped.view(), 2);
  EXPECT_EQ(lost.state, State::lost);
  EXPECT_EQ(lost.alignment.motion.translation(), Vector3d::Zero()) << "the last one known";
  auto pose = lost;
  for (unsigned i = 3; i < 20 && pose.state == State::lost; ++i) {
    pose = tracker.follow(jumped.view(), i);
  }
  ASSERT_EQ(pose.state, State::recovered);
  EXPECT_LT(error_of(pose.alignment, away).um, 5);
  EXPECT_LT(error_of(pose.alignment, away).degrees, 0.2);
  EXPECT_EQ(tracker.follow(jumped.view(), 20).state, State::tracked);
}

TEST(Tracker, AnotherObjectIsNotTakenForIt) {
  Tracker tracker;
  const Frame first(bumps(), Motion::Identity());
  (void)tracker.follow(first.view(), 1);
  const Frame other({{{{0, 0, 3.2}, 4.0}}}, Motion::Identity());
  for (unsigned i = 2; i < 20; ++i) {
    EXPECT_EQ(tracker.follow(other.view(), i).state, State::lost);
  }
}

TEST(Tracker, ANewContactBeginsAnew) {
  Tracker tracker;
  const Frame first(bumps(), Motion::Identity());
  (void)tracker.follow(first.view(), 1);
  tracker.release();
  EXPECT_EQ(tracker.pose().state, State::idle);
  const auto& pose = tracker.follow(first.view(), 7);
  EXPECT_EQ(pose.state, State::started);
  EXPECT_EQ(pose.since, 7U);
  const Frame nothing({}, Motion::Identity());
  tracker.release();
  EXPECT_EQ(tracker.follow(nothing.view(), 8).state, State::idle);
}

}  // namespace
}  // namespace dtact::perceive
