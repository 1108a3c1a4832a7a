// Frames with the pose of a known object.
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "clients/perceive/frame_maker.hpp"
#include "clients/perceive/object_file.hpp"
#include "proto/dtact.pb.h"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/perceive/balls.hpp"

namespace dtact::perceive {
namespace {

using namespace test;
using Eigen::Vector3d;
using v1::ObjectPose;

/// The frame's message, as the daemon sends it.
v1::Frame sent(const Frame& seen, std::uint64_t sequence) {
  v1::Frame frame;
  frame.set_sequence(sequence);
  frame.mutable_contact()->set_in_contact(true);
  v1::DepthMap& map = *frame.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(kWidth);
  map.set_height(kHeight);
  map.set_full_width(kWidth);
  map.set_full_height(kHeight);
  map.set_mm_per_px(kPx);
  map.set_um_per_unit(1);
  map.set_untrusted_value(-32768);
  map.set_decimation(1);
  map.set_uncertainty_um(10);
  map.set_data(seen.values.data(), sizeof(std::int16_t) * seen.values.size());
  return frame;
}

v1::Frame nothing(std::uint64_t sequence) {
  v1::Frame frame;
  frame.set_sequence(sequence);
  frame.mutable_contact()->set_in_contact(false);
  return frame;
}

ObjectPose pose_of(FrameMaker& maker, v1::Frame frame) {
  maker.begin(std::move(frame), {.pose = true});
  net::FrameKind kind;
  kind.pose = true;
  v1::Frame made;
  EXPECT_TRUE(made.ParseFromString(maker.make(kind)->body));
  EXPECT_TRUE(made.has_pose());
  return made.pose();
}

/// The first pose that is not SEARCHING, while frames of the same contact come. The search
/// is slow under the thread sanitizer.
ObjectPose found(FrameMaker& maker, const Frame& seen, std::uint64_t& sequence) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(4);
  for (;;) {
    ObjectPose pose = pose_of(maker, sent(seen, ++sequence));
    if (pose.tracking() != ObjectPose::SEARCHING) return pose;
    EXPECT_EQ(pose.object(), "balls");
    if (std::chrono::steady_clock::now() > end) return pose;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

TEST(FrameMakerOfAnObject, SearchesFindsAndFollowsInEachContact) {
  FrameMaker maker(model_of(bumps()));
  std::uint64_t sequence = 10;
  for (const double x_mm : {0.2, -0.3}) {
    const Frame seen(bumps(), moved({x_mm, 0.1, 0}, Vector3d::UnitZ(), 60), 5);
    ObjectPose pose = pose_of(maker, sent(seen, ++sequence));
    EXPECT_EQ(pose.tracking(), ObjectPose::SEARCHING);
    EXPECT_EQ(pose.object(), "balls");

    pose = found(maker, seen, sequence);
    ASSERT_EQ(pose.tracking(), ObjectPose::STARTED);
    EXPECT_EQ(pose.object(), "balls");
    EXPECT_EQ(pose.since_sequence(), sequence);

    pose = pose_of(maker, sent(seen, ++sequence));
    EXPECT_EQ(pose.tracking(), ObjectPose::TRACKED);
    EXPECT_EQ(pose.object(), "balls");
    EXPECT_NEAR(pose.translation_mm().x(), x_mm, 0.03);
    EXPECT_NEAR(pose.translation_mm().y(), 0.1, 0.03);
    EXPECT_NEAR(pose.translation_mm().z(), 0, 0.03);
    EXPECT_NEAR(pose.rotation_deg().z(), 60, 1);

    maker.begin(nothing(++sequence), {.pose = true});
    net::FrameKind kind;
    kind.pose = true;
    v1::Frame made;
    ASSERT_TRUE(made.ParseFromString(maker.make(kind)->body));
    EXPECT_FALSE(made.has_pose());
  }
}

// A frame's text that is not UTF-8 would make its message unreadable.
TEST(FrameMakerOfAnObject, ItsNameIsUtf8) {
  const std::filesystem::path file = fakes::own_path("Schl\xfcssel.ply");
  std::filesystem::copy_file(DTACT_SOURCE_DIR "/tests/fuzz/corpus/mesh/ascii.ply", file);
  const auto object = load_object(file, "mm");
  std::filesystem::remove(file);
  EXPECT_TRUE(object->name.ends_with("Schl?ssel")) << object->name;
}

TEST(FrameMakerOfAnObject, AShapeThatIsTooLargeIsRefusedWithItsLimit) {
  const std::filesystem::path file = fakes::own_path("large.stl");
  std::ofstream(file).close();
  std::filesystem::resize_file(file, (64U << 20U) + 1);
  EXPECT_THAT([&] { (void)load_object(file, "mm"); },
              testing::ThrowsMessage<std::runtime_error>(
                  testing::HasSubstr("larger than 64 MiB: simplify the mesh")));
  std::filesystem::remove(file);
}

// Another calibration may place the same pixels elsewhere, and a daemon that was away does not
// report what happened meanwhile.
TEST(FrameMaker, AnotherCalibrationAndAReleaseBeginAnotherContact) {
  FrameMaker maker;
  const Frame seen(bumps(), Motion::Identity(), 5);
  const auto tracking = [&](std::uint64_t sequence, std::uint64_t calibration) {
    v1::Frame frame = sent(seen, sequence);
    frame.set_calibration(calibration);
    return pose_of(maker, std::move(frame)).tracking();
  };
  EXPECT_EQ(tracking(1, 0), ObjectPose::STARTED);
  EXPECT_EQ(tracking(2, 0), ObjectPose::TRACKED);
  EXPECT_EQ(tracking(3, 7), ObjectPose::STARTED);
  EXPECT_EQ(tracking(4, 7), ObjectPose::TRACKED);
  maker.release();
  EXPECT_EQ(tracking(5, 7), ObjectPose::STARTED);
}

TEST(FrameMakerOfAnObject, WhatIsAnotherObjectIsNeverPlaced) {
  FrameMaker maker(model_of(bumps()));
  const Frame ball({{{{0, 0, 3.0}, 4.0}}}, Motion::Identity(), 5);
  for (std::uint64_t sequence = 1; sequence < 40; ++sequence) {
    EXPECT_EQ(pose_of(maker, sent(ball, sequence)).tracking(), ObjectPose::SEARCHING);
  }
}

}  // namespace
}  // namespace dtact::perceive
