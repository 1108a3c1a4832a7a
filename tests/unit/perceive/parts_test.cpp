// The parts of dtact-perceive that read and write messages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <tuple>
#include <vector>

#include "clients/cpp/errors.hpp"
#include "clients/perceive/cloud_message.hpp"
#include "clients/perceive/depth_crop.hpp"
#include "clients/perceive/frame_maker.hpp"
#include "clients/perceive/pose_message.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {
namespace {

using testing::ElementsAre;

/// Columns 10 … 13 and rows 20 … 22 of a map at half resolution.
v1::DepthMap map_of(const std::vector<std::int16_t>& values) {
  v1::DepthMap map;
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(4);
  map.set_height(3);
  map.set_x(10);
  map.set_y(20);
  map.set_full_width(100);
  map.set_full_height(80);
  map.set_mm_per_px(0.1);
  map.set_um_per_unit(1);
  map.set_untrusted_value(-32768);
  map.set_decimation(2);
  map.set_data(values.data(), 2 * values.size());
  return map;
}

TEST(DepthCrop, CutsRegionsOfTheCalibrationsResolution) {
  DepthCrop part(map_of({0, 1, 2, 3, 10, 11, 12, 13, 20, 21, 22, 23}));
  EXPECT_EQ(part.whole().full_width, 100);
  // 23 … 26, extended to the map's columns 11 … 13.
  const auto cut = part.cut({23, 42, 4, 1});
  ASSERT_TRUE(cut.has_value());
  EXPECT_EQ(cut->x, 11);
  EXPECT_EQ(cut->y, 21);
  EXPECT_THAT(cut->values, ElementsAre(11, 12, 13));
  EXPECT_FALSE(part.cut({0, 0, 10, 10}).has_value());
  // As far as the map goes.
  const auto rest = part.cut({23, 42, UINT32_MAX, UINT32_MAX});
  ASSERT_TRUE(rest.has_value());
  EXPECT_EQ(rest->width, 3);
  EXPECT_EQ(rest->height, 2);
  EXPECT_FALSE(part.cut({3'000'000'000U, 42, 1, 4}).has_value());
}

TEST(DepthCrop, RefusesMapsThatContradictThemselves) {
  const v1::DepthMap good = map_of(std::vector<std::int16_t>(12, 100));
  const auto with = [&good](const std::function<void(v1::DepthMap&)>& change) {
    v1::DepthMap map = good;
    change(map);
    return [map] { const DepthCrop part(map); };
  };
  EXPECT_NO_THROW(with([](v1::DepthMap&) {})());
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_x(97); })(), client::ProtocolError);
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_y(0xFFFFFFFF); })(), client::ProtocolError);
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_full_width(1U << 20U); })(),
               client::ProtocolError);
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_mm_per_px(0); })(), client::ProtocolError);
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_um_per_unit(-1); })(), client::ProtocolError);
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_mm_per_px(1e-9); })(), client::ProtocolError);
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_mm_per_px(INFINITY); })(),
               client::ProtocolError);
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_um_per_unit(1e-300); })(),
               client::ProtocolError);
  EXPECT_THROW(with([](v1::DepthMap& map) { map.set_decimation(0x7FFFFFFF); })(),
               client::ProtocolError);
}

v1::Contact contact_of(double deepest_mm, double threshold_mm = 0.1) {
  v1::Contact contact;
  contact.set_deepest_mm(deepest_mm);
  contact.set_threshold_mm(threshold_mm);
  return contact;
}

TEST(DepthCrop, TheContactHasAMargin) {
  std::vector<std::int16_t> values(12, 100);
  DepthCrop none(map_of(values));
  EXPECT_FALSE(none.contact(contact_of(0.3)).has_value()) << "not deeper than the threshold";
  values[5] = 101;
  DepthCrop part(map_of(values));
  const auto contact = part.contact(contact_of(0.3));
  ASSERT_TRUE(contact.has_value());
  EXPECT_EQ(contact->width, 4) << "cut at the map's border";
  EXPECT_EQ(contact->height, 3);
}

TEST(DepthCrop, TheContactIsWhatTheDaemonCountsAsContact) {
  std::vector<std::int16_t> values(40, 0);
  values[2] = 60;
  values[35] = 800;
  v1::DepthMap map = map_of(values);
  map.clear_x();
  map.clear_y();
  map.set_decimation(1);
  map.set_width(40);
  map.set_height(1);
  DepthCrop part(map);
  const auto left_of = [&part](double threshold_mm) {
    const auto contact = part.contact(contact_of(0.8, threshold_mm));
    return contact ? contact->x : -1;
  };
  EXPECT_EQ(left_of(0.02), 0) << "both";
  EXPECT_EQ(left_of(0.3), 35 - DepthCrop::kMarginPx);
}

TEST(DepthCrop, ALightPressHasAContactAsWell) {
  std::vector<std::int16_t> values(12, 20);
  values[5] = 42;
  DepthCrop part(map_of(values));
  EXPECT_TRUE(part.contact(contact_of(0.042)).has_value());
  EXPECT_FALSE(part.contact(contact_of(0.2)).has_value());
}

// A map of 6 × 4 pixels at the calibration's resolution; a daemon of before `decimation` leaves it
// out.
TEST(DepthCrop, AMapOfTheCalibrationsResolutionIsCutByItsPixels) {
  for (const std::uint32_t decimation : {0U, 1U}) {
    std::vector<std::int16_t> values;
    for (std::int16_t i = 0; i < 24; ++i) values.push_back(i);
    v1::DepthMap map = map_of(values);
    map.clear_x();
    map.clear_y();
    map.set_width(6);
    map.set_height(4);
    map.set_decimation(decimation);
    DepthCrop part(map);
    EXPECT_EQ(part.decimation(), 1);
    const auto cut = part.cut({3, 1, 2, 3});
    ASSERT_TRUE(cut.has_value());
    EXPECT_EQ(cut->x, 3);
    EXPECT_EQ(cut->y, 1);
    EXPECT_EQ(cut->width, 2);
    EXPECT_EQ(cut->height, 3);
    EXPECT_THAT(cut->values, ElementsAre(9, 10, 15, 16, 21, 22));
  }
}

// 16 pixels of the calibration's resolution: eight of this map, whose 40 × 30 are part of another.
TEST(DepthCrop, TheMarginIsInPixelsOfTheCalibration) {
  std::vector<std::int16_t> values(1200, 0);
  values[11 * 40 + 20] = 800;
  values[14 * 40 + 22] = 700;
  v1::DepthMap map = map_of(values);
  map.set_width(40);
  map.set_height(30);
  DepthCrop part(map);
  const auto contact = part.contact(contact_of(0.8, 0.3));
  ASSERT_TRUE(contact.has_value());
  // Columns 20 to 22 and rows 11 to 14 of the part, which begins at (10, 20).
  EXPECT_EQ(contact->x, 10 + 20 - 8);
  EXPECT_EQ(contact->y, 20 + 11 - 8);
  EXPECT_EQ(contact->width, 3 + 16);
  EXPECT_EQ(contact->height, 4 + 16);
}

TEST(DepthCrop, RefusesADamagedMap) {
  EXPECT_THROW(DepthCrop(map_of({1, 2, 3})), client::ProtocolError);
}

TEST(CloudMessage, Float32AndInt16) {
  PointCloud cloud;
  cloud.width = 2;
  cloud.height = 1;
  const float hole = NAN;
  cloud.values = {0.001F, hole, -0.002F, hole, 0.0000034F, hole, 0, hole, 0.6F, hole, -0.8F, hole};
  v1::PointCloud message;
  fill(cloud, v1::CLOUD_FLOAT32, message);
  EXPECT_EQ(message.points(), 1U);
  EXPECT_EQ(message.metres_per_unit(), 1);
  ASSERT_EQ(message.data().size(), 48U);
  EXPECT_EQ(message.data().substr(8, 4), std::string("\x6F\x12\x03\xBB", 4)) << "-0.002";
  v1::PointCloud small;
  fill(cloud, v1::CLOUD_INT16, small);
  EXPECT_EQ(small.metres_per_unit(), 1e-6);
  ASSERT_EQ(small.data().size(), 24U);
  std::array<std::int16_t, 12> units{};
  std::memcpy(units.data(), small.data().data(), 24);
  EXPECT_THAT(units, ElementsAre(1000, -32768, -2000, -32768, 3, -32768, 0, -32768, 19660, -32768,
                                 -26214, -32768));
  // 65.534 mm: beyond 32767 micrometres.
  cloud.values[0] = 0.065534F;
  v1::PointCloud large;
  fill(cloud, v1::CLOUD_INT16, large);
  EXPECT_NEAR(large.metres_per_unit(), 2e-6, 1e-12);
}

TEST(PoseMessage, MillimetresAndDegrees) {
  Tracker::Pose pose;
  pose.state = Tracker::State::tracked;
  pose.since = 7;
  pose.alignment.motion.translation() = Eigen::Vector3d(0.001, 0, -0.0005);
  pose.alignment.motion.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  pose.alignment.rms = 4e-6;
  pose.alignment.arm = 2e-3;
  Twist unobservable = Twist::Zero();
  unobservable[4] = 1;
  pose.unobservable.push_back(unobservable);
  v1::ObjectPose message;
  fill(pose, message);
  EXPECT_EQ(message.tracking(), v1::ObjectPose::TRACKED);
  EXPECT_EQ(message.since_sequence(), 7U);
  EXPECT_DOUBLE_EQ(message.translation_mm().x(), 1);
  EXPECT_DOUBLE_EQ(message.translation_mm().z(), -0.5);
  EXPECT_NEAR(message.rotation_deg().z(), 90, 1e-9);
  EXPECT_NEAR(message.residual_um(), 4, 1e-9);
  EXPECT_DOUBLE_EQ(message.arm_mm(), 2);
  ASSERT_EQ(message.unobservable_size(), 1);
  EXPECT_EQ(message.unobservable(0).translation().y(), 1);
}

// Each number of its own, so that none stands for another.
TEST(PoseMessage, HasEachNumberInItsPlace) {
  Tracker::Pose pose;
  pose.state = Tracker::State::recovered;
  pose.since = 41;
  pose.alternatives = 5;
  pose.alignment.motion.translation() = Eigen::Vector3d(0.0015, -0.00225, 0.00075);
  pose.alignment.motion.linear() =
      Eigen::AngleAxisd(2 * M_PI / 3, Eigen::Vector3d(1, -2, 2) / 3).toRotationMatrix();
  pose.alignment.centre = Eigen::Vector3d(0.001, -0.002, 0.003);
  pose.alignment.arm = 0.0025;
  pose.alignment.rms = 12e-6;
  pose.alignment.points = 700;
  Twist unobservable;
  unobservable << 0.1, 0.2, 0.3, 0.4, 0.5, 0.6;
  pose.unobservable.push_back(unobservable);
  v1::ObjectPose message;
  fill(pose, message);
  EXPECT_EQ(message.tracking(), v1::ObjectPose::RECOVERED);
  EXPECT_TRUE(message.valid());
  EXPECT_EQ(message.since_sequence(), 41U);
  EXPECT_EQ(message.alternatives(), 5U);
  EXPECT_EQ(message.points(), 700U);
  EXPECT_NEAR(message.arm_mm(), 2.5, 1e-9);
  EXPECT_NEAR(message.residual_um(), 12, 1e-9);
  const auto is = [](const v1::Vector3& vector, double x, double y, double z) {
    EXPECT_NEAR(vector.x(), x, 1e-6);
    EXPECT_NEAR(vector.y(), y, 1e-6);
    EXPECT_NEAR(vector.z(), z, 1e-6);
  };
  is(message.translation_mm(), 1.5, -2.25, 0.75);
  is(message.rotation_deg(), 40, -80, 80);
  is(message.centre_mm(), 1, -2, 3);
  ASSERT_EQ(message.unobservable_size(), 1);
  is(message.unobservable(0).rotation(), 0.1, 0.2, 0.3);
  is(message.unobservable(0).translation(), 0.4, 0.5, 0.6);
}

TEST(PoseMessage, SaysWhichStatesHaveAMotion) {
  using State = Tracker::State;
  for (const auto& [state, tracking, valid] :
       {std::tuple(State::started, v1::ObjectPose::STARTED, true),
        {State::tracked, v1::ObjectPose::TRACKED, true},
        {State::recovered, v1::ObjectPose::RECOVERED, true},
        {State::lost, v1::ObjectPose::LOST, false},
        {State::searching, v1::ObjectPose::SEARCHING, false},
        {State::idle, v1::ObjectPose::UNSPECIFIED, false}}) {
    Tracker::Pose pose;
    pose.state = state;
    v1::ObjectPose message;
    fill(pose, message);
    EXPECT_EQ(message.tracking(), tracking);
    EXPECT_EQ(message.valid(), valid) << tracking;
    EXPECT_EQ(message.has_translation_mm(), state != State::searching) << tracking;
  }
}

/// The map as a part that covers the whole.
v1::DepthMap whole(v1::DepthMap map) {
  map.clear_x();
  map.clear_y();
  map.set_full_width(map.width());
  map.set_full_height(map.height());
  return map;
}

/// A frame with a depth map, indented by 23 µm.
v1::Frame frame_of(bool in_contact) {
  v1::Frame frame;
  frame.set_sequence(5);
  frame.set_dropped(3);
  frame.mutable_contact()->set_in_contact(in_contact);
  frame.mutable_contact()->set_deepest_mm(0.023);
  *frame.mutable_depth() = whole(map_of({0, 1, 2, 3, 10, 11, 12, 13, 20, 21, 22, 23}));
  return frame;
}

v1::Frame made(FrameMaker& maker, const net::FrameKind& kind) {
  v1::Frame frame;
  EXPECT_TRUE(frame.ParseFromString(maker.make(kind)->body));
  return frame;
}

TEST(FrameMaker, SendsWhatIsDueAndTheSameBufferToEveryone) {
  FrameMaker maker;
  maker.begin(frame_of(true), {});
  net::FrameKind points;
  points.cloud = v1::CLOUD_FLOAT32;
  const v1::Frame frame = made(maker, points);
  EXPECT_EQ(frame.sequence(), 5U);
  EXPECT_EQ(frame.dropped(), 0U);
  EXPECT_FALSE(frame.has_depth());
  EXPECT_EQ(frame.cloud().width(), 4U);
  EXPECT_EQ(frame.cloud().decimation(), 2U);
  EXPECT_EQ(maker.make(points), maker.make(points));
  EXPECT_FALSE(made(maker, {}).has_cloud());
  points.spec.decimation = 4;
  EXPECT_EQ(made(maker, points).cloud().width(), 2U);
}

TEST(FrameMaker, RecognisesOnlyOnRequestAndDuringContact) {
  FrameMaker maker;
  net::FrameKind wanted;
  wanted.recognition = 1;
  maker.begin(frame_of(true), {});
  EXPECT_FALSE(made(maker, wanted).has_recognition());
  maker.begin(frame_of(true), {.recognition = true});
  maker.wait();
  EXPECT_EQ(made(maker, wanted).recognition().verdict(), v1::Recognition::TOO_SHALLOW);
  EXPECT_FALSE(made(maker, {}).has_recognition());
  maker.begin(frame_of(false), {.recognition = true});
  EXPECT_FALSE(made(maker, wanted).has_recognition());
}

TEST(FrameMaker, PressesOfAnotherCalibrationAreNotJoined) {
  FrameMaker maker;
  net::FrameKind wanted;
  wanted.recognition = 5;
  const auto begin = [&maker](bool in_contact, std::uint64_t calibration) {
    v1::Frame frame = frame_of(in_contact);
    frame.set_calibration(calibration);
    *frame.mutable_depth() = whole(map_of(std::vector<std::int16_t>(12, 800)));
    maker.begin(frame, {.recognition = true});
  };
  const auto presses = [&](std::uint64_t calibration) {
    begin(true, calibration);
    maker.wait();
    const std::uint32_t joined = made(maker, wanted).recognition().presses();
    begin(false, calibration);
    return joined;
  };
  EXPECT_EQ(presses(1), 1U);
  EXPECT_EQ(presses(1), 2U);
  EXPECT_EQ(presses(2), 1U);
  EXPECT_EQ(presses(2), 2U);
}

TEST(FrameMaker, OfAPartOfTheMapThereAreNoPointsOfAll) {
  FrameMaker maker;
  v1::Frame part = frame_of(true);
  *part.mutable_depth() = map_of({0, 1, 2, 3, 10, 11, 12, 13, 20, 21, 22, 23});
  maker.begin(part, {});
  net::FrameKind points;
  points.cloud = v1::CLOUD_FLOAT32;
  EXPECT_FALSE(made(maker, points).has_cloud());
  points.contact_box = true;
  EXPECT_TRUE(made(maker, points).has_cloud());
}

// 920 × 920 points of 24 bytes are beyond 16 MiB.
TEST(FrameMaker, PointsThatDoNotFitAMessageAreMadeCoarser) {
  constexpr std::uint32_t kSide = 920;
  FrameMaker maker;
  v1::Frame frame = frame_of(true);
  v1::DepthMap& map = *frame.mutable_depth();
  map.set_decimation(1);
  map.set_width(kSide);
  map.set_height(kSide);
  map.set_full_width(kSide);
  map.set_full_height(kSide);
  map.set_data(std::string(2 * kSide * kSide, '\0'));
  maker.begin(frame, {});
  net::FrameKind points;
  points.cloud = v1::CLOUD_INT16;
  EXPECT_EQ(made(maker, points).cloud().decimation(), 1U);
  points.cloud = v1::CLOUD_FLOAT32;
  const v1::Frame coarse = made(maker, points);
  EXPECT_EQ(coarse.cloud().decimation(), 2U);
  EXPECT_EQ(coarse.cloud().width(), kSide / 2);
}

TEST(FrameMaker, WithoutContactNoPoints) {
  FrameMaker maker;
  maker.begin(frame_of(false), {.pose = true});
  net::FrameKind all;
  all.cloud = v1::CLOUD_FLOAT32;
  all.pose = true;
  const v1::Frame frame = made(maker, all);
  EXPECT_FALSE(frame.has_cloud());
  EXPECT_FALSE(frame.has_pose());
}

TEST(FrameMaker, KnowsACurvedSurface) {
  FrameMaker maker;
  v1::Frame bent = frame_of(true);
  *bent.mutable_depth() = map_of({0, 1, 2, 3, 10, 11, 12, 13, 20, 21, 22, 23});
  auto& surface = *bent.mutable_surface();
  surface.set_shape(v1::Surface::SPHERE);
  surface.set_radius_mm(10);
  surface.set_air_mm(20);
  surface.set_gel_mm(5);
  surface.set_refraction(1.41);
  maker.begin(bent, {.pose = true});
  net::FrameKind all;
  all.cloud = v1::CLOUD_FLOAT32;
  all.contact_box = true;
  all.pose = true;
  const v1::Frame frame = made(maker, all);
  ASSERT_TRUE(frame.has_cloud());
  EXPECT_FALSE(frame.has_pose()) << "not followed there";
  float z = 0;
  std::memcpy(&z, frame.cloud().data().data() + 2 * 12 * sizeof z, sizeof z);
  EXPECT_LT(z, -5e-4F) << "4 mm from the middle of a sphere of 10 mm";
}

}  // namespace
}  // namespace dtact::perceive
