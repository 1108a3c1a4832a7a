// The motion of objects that slide by 4 mm, twist by 30°, or are pressed deeper, at 12
// frames a second, as the tracker finds it. Against where the scene puts the object; only in the
// directions that the tracker says it sees.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/accuracy/pose/normal_flow.hpp"
#include "tests/accuracy/pose/sequence.hpp"
#include "tests/bench/cpu_time.hpp"
#include "tests/unit/perceive/balls.hpp"

namespace dtact::pose {
namespace {

using perceive::CloudMaker;
using perceive::ContactView;
using perceive::PointCloud;
using perceive::Tracker;
using perceive::test::Error;

constexpr int kEvery = 5;
constexpr int kSteps = 2 * Sequence::kFps / kEvery;

struct Result {
  Error last;
  Error worst;
  int lost = 0;
  std::size_t hidden = 0;
};

Result follow(const std::string& object, const Way& way, const recon::Surface& surface) {
  Sequence frames(object, keys_of(way, kSteps), surface);
  Tracker tracker;
  CloudMaker maker(surface);
  PointCloud cloud;
  std::vector<double> times;
  Result result;
  for (std::uint64_t sequence = 0; sequence <= 2 * Sequence::kFps; sequence += kEvery) {
    const Map map = frames.map(sequence);
    const double before = bench::thread_us();
    maker.make(map.grid, 1, cloud);
    const auto& pose = tracker.follow(ContactView(map.grid, cloud, maker.table(), 10), sequence);
    times.push_back(bench::thread_us() - before);
    if (pose.state == Tracker::State::lost) {
      ++result.lost;
      continue;
    }
    result.last = perceive::test::error_of(pose.alignment, frames.motion(sequence));
    result.worst.um = std::max(result.worst.um, result.last.um);
    result.worst.degrees = std::max(result.worst.degrees, result.last.degrees);
    result.hidden = pose.alignment.unobservable.size();
  }
  std::sort(times.begin(), times.end());
  std::printf(
      "%-40s %-7s %zu hidden: at the end %5.1f um %5.2f deg, worst %5.1f um %5.2f deg; %4.0f us\n",
      object.substr(0, 40).c_str(), way.name, result.hidden, result.last.um, result.last.degrees,
      result.worst.um, result.worst.degrees, times[times.size() / 2]);
  return result;
}

void expect_found(const std::string& object, const Way& way, std::size_t most_hidden,
                  const recon::Surface& surface = {}) {
  const Result result = follow(object, way, surface);
  EXPECT_EQ(result.lost, 0);
  EXPECT_LT(result.worst.um, 80);
  EXPECT_LT(result.worst.degrees, 1.0);
  EXPECT_LE(result.hidden, most_hidden);
}

TEST(PoseOnTheSimulatedLayer, M4Nut) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) expect_found("object = \"m4_nut\"", way, 1);
}

TEST(PoseOnTheSimulatedLayer, Cube) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) {
    expect_found("object = \"cube\"\nside_mm = 5.0", way, 0);
  }
}

TEST(PoseOnTheSimulatedLayer, ABallShowsThreeDirections) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) {
    expect_found("object = \"ball\"\nradius_mm = 4.0", way, 3);
  }
}

// What rolls so that only an edge stays in the layer, and what its shape does not show there: a
// cylinder about its short side spins meanwhile about its own axis, by 16° and 0.6 mm, which is
// told. Of what is not told it is 2.3° and 0.12 mm off, the others 1.6° and 0.09 mm.
TEST(PoseOnTheSimulatedLayer, WhatARollOntoAnEdgeDoesNotShowIsTold) {
  for (const char* object : {"object = \"cylinder\"\nradius_mm = 2.5\nlength_mm = 8.0",
                             "object = \"disc\"\nradius_mm = 4.0", "object = \"usb_c_plug\"",
                             "object = \"three_set_screws\""}) {
    const Result result = follow(object, kRoll, {});
    EXPECT_EQ(result.lost, 0) << object;
    EXPECT_GE(result.hidden, 1U) << object;
    EXPECT_LT(result.worst.um, 150) << object;
    EXPECT_LT(result.worst.degrees, 3) << object;
  }
}

// Slid and twisted for ten seconds, so far that other frames are compared with than the first.
TEST(PoseOnTheSimulatedLayer, ACubeThatComesBackIsWhereItWas) {
  constexpr int kEachSecond = 10;
  Sequence frames("object = \"cube\"\nside_mm = 5.0", keys_of_a_minute(60 * kEachSecond));
  Tracker tracker;
  CloudMaker maker;
  PointCloud cloud;
  constexpr std::uint64_t kBack = std::uint64_t{10} * Sequence::kFps;
  for (std::uint64_t sequence = 0; sequence <= kBack; sequence += Sequence::kFps / kEachSecond) {
    const Map map = frames.map(sequence);
    maker.make(map.grid, 1, cloud);
    const auto& pose = tracker.follow(ContactView(map.grid, cloud, maker.table(), 10), sequence);
    ASSERT_NE(pose.state, Tracker::State::lost) << sequence;
  }
  const Error error = perceive::test::error_of(tracker.pose().alignment, frames.motion(kBack));
  EXPECT_LT(error.um, 2);
  EXPECT_LT(error.degrees, 0.05);
}

class PoseOnAFinger : public testing::TestWithParam<recon::Surface> {};

TEST_P(PoseOnAFinger, M4Nut) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) {
    expect_found("object = \"m4_nut\"", way, 1, GetParam());
  }
}

TEST_P(PoseOnAFinger, Cube) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) {
    expect_found("object = \"cube\"\nside_mm = 5.0", way, 0, GetParam());
  }
}

TEST_P(PoseOnAFinger, ABallShowsThreeDirections) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) {
    expect_found("object = \"ball\"\nradius_mm = 4.0", way, 3, GetParam());
  }
}

INSTANTIATE_TEST_SUITE_P(Surfaces, PoseOnAFinger, testing::Values(kSphere, kCylinder));

// Those that it is compared with have to be able to.
TEST(NormalFlow, FollowsACube) {
  for (const Way& way : {kSlide, kTwist}) {
    Sequence frames("object = \"cube\"\nside_mm = 5.0", keys_of(way, kSteps));
    NormalFlow flow;
    CloudMaker maker;
    PointCloud cloud;
    for (std::uint64_t sequence = 0; sequence <= 2 * Sequence::kFps; sequence += kEvery) {
      const Map map = frames.map(sequence);
      maker.make(map.grid, 1, cloud);
      const auto& pose = flow.follow(map.grid, cloud, ContactView(map.grid, cloud, nullptr, 10));
      ASSERT_FALSE(pose.lost) << way.name << ", frame " << sequence;
      const perceive::Motion truth = frames.motion(sequence);
      const Eigen::AngleAxisd off(pose.motion.rotation * truth.rotation.transpose());
      EXPECT_LT(off.angle() * 180 / M_PI, 1.5) << way.name << ", frame " << sequence;
      EXPECT_LT((pose.motion.translation - truth.translation).norm(), 80e-6)
          << way.name << ", frame " << sequence;
    }
  }
}

}  // namespace
}  // namespace dtact::pose
