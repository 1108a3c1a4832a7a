#include "clients/dds/messages.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "clients/dds/ros2.h"
#include "tests/unit/dds/graph_fixture.hpp"

namespace dtact::dds {
namespace {

/// Both ends of a topic.
struct Topic {
  dds_entity_t writer;
  dds_entity_t reader;
};

/// Messages with all fields different, so that none stands for another.
class DdsMessages : public Dds {
 protected:
  Topic topic(const dds_topic_descriptor_t& type) {
    const dds_entity_t writer =
        graph->add_writer(graph->add_node("/test", "test"), "/test/one", type, Qos::command);
    return {writer, subscribe("/test/one")};
  }
  /// Takes the one message that there is.
  template <typename Message, typename Check>
  void check_one(const Topic& topic, const dds_topic_descriptor_t& type, Check check) {
    EXPECT_EQ(take<Message>(topic.reader, type, 2, check), 1U);
  }

  const Header header{3'000'000'007, "left_surface_optical"};
};

TEST_F(DdsMessages, TheMapsScaleAndCentre) {
  const auto& type = sensor_msgs_msg_dds__CameraInfo__desc;
  const Topic one = topic(type);
  v1::DepthMap map;
  map.set_width(500);
  map.set_height(401);
  map.set_mm_per_px(0.04);
  write_camera_info(one.writer, header, map);
  check_one<sensor_msgs_msg_dds__CameraInfo_>(one, type, [&](const auto& info) {
    EXPECT_EQ(info.header.stamp.sec, 3);
    EXPECT_EQ(info.header.stamp.nanosec, 7U);
    EXPECT_STREQ(info.header.frame_id, "left_surface_optical");
    EXPECT_EQ(info.width, 500U);
    EXPECT_EQ(info.height, 401U);
    EXPECT_STREQ(info.distortion_model, "");
    EXPECT_THAT(info.k, testing::ElementsAre(testing::DoubleNear(25000, 1e-6), 0, 249.5, 0,
                                             testing::DoubleNear(25000, 1e-6), 200, 0, 0, 1));
    EXPECT_THAT(info.r, testing::ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1));
    // (x, y, z) is at pixel (25000 x + 249.5, 25000 y + 200), whatever z is.
    EXPECT_THAT(info.p, testing::ElementsAre(testing::DoubleNear(25000, 1e-6), 0, 0, 249.5, 0,
                                             testing::DoubleNear(25000, 1e-6), 0, 200, 0, 0, 0, 1));
  });
}

TEST_F(DdsMessages, ImagesInMetresAndInMicrometres) {
  const auto& type = sensor_msgs_msg_dds__Image__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  auto& map = *frame.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(3);
  map.set_height(1);
  map.set_um_per_unit(2);
  map.set_untrusted_value(-32768);
  map.set_data(std::string("\x01\0\0\x80\xff\xff", 6));  // 1, untrusted, −1
  write_image(one.writer, header, frame, true);
  check_one<sensor_msgs_msg_dds__Image_>(one, type, [&](const auto& image) {
    EXPECT_EQ(image.width, 3U);
    EXPECT_EQ(image.height, 1U);
    EXPECT_STREQ(image.encoding, "32FC1");
    EXPECT_EQ(image.step, 12U);
    EXPECT_EQ(image.is_bigendian, 0);
    ASSERT_EQ(image.data._length, 12U);
    std::array<float, 3> metres{};
    std::memcpy(metres.data(), image.data._buffer, 12);
    EXPECT_NEAR(metres[0], 2e-6, 1e-12);
    EXPECT_TRUE(std::isnan(metres[1]));
    EXPECT_NEAR(metres[2], -2e-6, 1e-12);
  });
  write_image(one.writer, header, frame, false);
  check_one<sensor_msgs_msg_dds__Image_>(one, type, [&](const auto& image) {
    EXPECT_STREQ(image.encoding, "16UC1");
    EXPECT_EQ(image.step, 6U);
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(image.data._buffer), image.data._length),
              std::string("\x02\0\0\0\0\0", 6));
  });
}

TEST_F(DdsMessages, AContactInMetresAndNewtons) {
  const auto& type = dtact_msgs_msg_dds__Contact__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  frame.set_sequence(41);
  frame.set_dropped(3);
  frame.add_health(v1::HEALTH_STARTING);
  frame.mutable_depth()->set_uncertainty_um(23);
  auto& contact = *frame.mutable_contact();
  contact.set_in_contact(true);
  contact.set_area_mm2(6);
  contact.set_x_mm(1.5);
  contact.set_y_mm(-2.5);
  contact.set_deepest_mm(0.75);
  contact.set_deepest_x_mm(1.25);
  contact.set_deepest_y_mm(-3.5);
  contact.set_volume_mm3(4);
  contact.set_threshold_mm(0.03);
  contact.set_force_n(2);
  contact.set_force_uncertainty_n(0.25);
  write_contact(one.writer, header, frame);
  check_one<dtact_msgs_msg_dds__Contact_>(one, type, [&](const auto& it) {
    EXPECT_EQ(it.header.stamp.nanosec, 7U);
    EXPECT_EQ(it.frame_number, 41U);
    EXPECT_EQ(it.dropped, 3U);
    ASSERT_EQ(it.health._length, 1U);
    EXPECT_STREQ(it.health._buffer[0], "starting");
    EXPECT_TRUE(it.measured);
    EXPECT_STREQ(it.absence, "");
    EXPECT_TRUE(it.in_contact);
    EXPECT_NEAR(it.area, 6e-6, 1e-15);
    EXPECT_NEAR(it.centroid.x, 1.5e-3, 1e-12);
    EXPECT_NEAR(it.centroid.y, -2.5e-3, 1e-12);
    EXPECT_EQ(it.centroid.z, 0);
    EXPECT_NEAR(it.indentation, 0.75e-3, 1e-12);
    EXPECT_NEAR(it.deepest_at.x, 1.25e-3, 1e-12);
    EXPECT_NEAR(it.deepest_at.y, -3.5e-3, 1e-12);
    EXPECT_NEAR(it.volume, 4e-9, 1e-18);
    EXPECT_NEAR(it.threshold, 0.03e-3, 1e-12);
    EXPECT_NEAR(it.uncertainty, 23e-6, 1e-12);
    EXPECT_EQ(it.force, 2);
    EXPECT_EQ(it.force_uncertainty, 0.25);
    EXPECT_STREQ(it.force_absence, "");
  });
  contact.clear_force_n();
  contact.clear_force_uncertainty_n();
  contact.set_force_absence(v1::FORCE_ABSENCE_CUT_OFF);
  frame.clear_depth();
  write_contact(one.writer, header, frame);
  check_one<dtact_msgs_msg_dds__Contact_>(one, type, [&](const auto& it) {
    EXPECT_TRUE(std::isnan(it.force));
    EXPECT_TRUE(std::isnan(it.force_uncertainty));
    EXPECT_TRUE(std::isnan(it.uncertainty));
    EXPECT_STREQ(it.force_absence, "cut_off");
  });
  frame.clear_contact();
  frame.set_contact_absence(v1::CONTACT_ABSENCE_REFERENCING);
  write_contact(one.writer, header, frame);
  check_one<dtact_msgs_msg_dds__Contact_>(one, type, [&](const auto& it) {
    EXPECT_FALSE(it.measured);
    EXPECT_STREQ(it.absence, "referencing");
    EXPECT_STREQ(it.force_absence, "");
  });
}

// On a sphere of 10 mm whose apex is the origin the normal at the side leans outwards.
TEST_F(DdsMessages, AWrenchAboutTheOrigin) {
  const auto& type = geometry_msgs_msg_dds__WrenchStamped__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  write_wrench(one.writer, header, frame);  // nothing: no force is known
  auto& contact = *frame.mutable_contact();
  contact.set_force_n(2);
  contact.set_x_mm(1.5);
  contact.set_y_mm(-2.5);
  write_wrench(one.writer, header, frame);
  check_one<geometry_msgs_msg_dds__WrenchStamped_>(one, type, [&](const auto& it) {
    EXPECT_STREQ(it.header.frame_id, "left_surface_optical");
    EXPECT_NEAR(it.wrench.force.x, 0, 1e-12);
    EXPECT_NEAR(it.wrench.force.y, 0, 1e-12);
    EXPECT_NEAR(it.wrench.force.z, -2, 1e-12);
    // (1.5, −2.5, 0) mm × (0, 0, −2) N.
    EXPECT_NEAR(it.wrench.torque.x, 5e-3, 1e-12);
    EXPECT_NEAR(it.wrench.torque.y, 3e-3, 1e-12);
    EXPECT_NEAR(it.wrench.torque.z, 0, 1e-12);
  });
  auto& surface = *frame.mutable_surface();
  surface.set_shape(v1::Surface::SPHERE);
  surface.set_radius_mm(10);
  surface.set_air_mm(20);
  surface.set_gel_mm(5);
  surface.set_refraction(1.41);
  write_wrench(one.writer, header, frame);
  check_one<geometry_msgs_msg_dds__WrenchStamped_>(one, type, [&](const auto& it) {
    const auto& f = it.wrench.force;
    EXPECT_NEAR(std::hypot(f.x, f.y, f.z), 2, 1e-9);
    EXPECT_LT(f.x, -0.2);
    EXPECT_GT(f.y, 0.4);
    // It goes through the sphere's middle, (0, 0, −10) mm: the torque about that is none, and so
    // that about the origin is (0, 0, −0.01) × f.
    EXPECT_NEAR(it.wrench.torque.x, 0.01 * f.y, 1e-6);
    EXPECT_NEAR(it.wrench.torque.y, -0.01 * f.x, 1e-6);
    EXPECT_NEAR(it.wrench.torque.z, 0, 1e-6);
  });
}

TEST_F(DdsMessages, APose) {
  const auto& type = geometry_msgs_msg_dds__PoseStamped__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  auto& pose = *frame.mutable_pose();
  pose.mutable_translation_mm()->set_x(1.5);
  pose.mutable_translation_mm()->set_y(-2.25);
  pose.mutable_translation_mm()->set_z(0.75);
  // 120° about (1, −2, 2) / 3.
  pose.mutable_rotation_deg()->set_x(40);
  pose.mutable_rotation_deg()->set_y(-80);
  pose.mutable_rotation_deg()->set_z(80);
  write_pose(one.writer, header, frame);
  check_one<geometry_msgs_msg_dds__PoseStamped_>(one, type, [&](const auto& it) {
    EXPECT_EQ(it.header.stamp.sec, 3);
    EXPECT_NEAR(it.pose.position.x, 0.0015, 1e-12);
    EXPECT_NEAR(it.pose.position.y, -0.00225, 1e-12);
    EXPECT_NEAR(it.pose.position.z, 0.00075, 1e-12);
    EXPECT_NEAR(it.pose.orientation.x, 0.28867513, 1e-8);
    EXPECT_NEAR(it.pose.orientation.y, -0.57735027, 1e-8);
    EXPECT_NEAR(it.pose.orientation.z, 0.57735027, 1e-8);
    EXPECT_NEAR(it.pose.orientation.w, 0.5, 1e-8);
  });
}

TEST_F(DdsMessages, TheTrackingOfAnObject) {
  const auto& type = dtact_msgs_msg_dds__ObjectTracking__desc;
  const Topic one = topic(type);
  v1::ObjectPose pose;
  pose.set_valid(true);
  pose.set_tracking(v1::ObjectPose::RECOVERED);
  pose.set_object("nut");
  pose.set_since_sequence(41);
  pose.set_alternatives(5);
  pose.add_unobservable();
  pose.add_unobservable();
  pose.set_residual_um(12);
  write_tracking(one.writer, header, pose);
  check_one<dtact_msgs_msg_dds__ObjectTracking_>(one, type, [&](const auto& it) {
    EXPECT_STREQ(it.header.frame_id, "left_surface_optical");
    EXPECT_TRUE(it.valid);
    EXPECT_STREQ(it.tracking, "recovered");
    EXPECT_STREQ(it.object_name, "nut");
    EXPECT_EQ(it.since_sequence, 41U);
    EXPECT_EQ(it.alternatives, 5U);
    EXPECT_EQ(it.unobservable, 2U);
    EXPECT_NEAR(it.residual, 12e-6, 1e-15);
  });
}

TEST_F(DdsMessages, WhatTheObjectIs) {
  const auto& type = dtact_msgs_msg_dds__Recognition__desc;
  const Topic one = topic(type);
  v1::Recognition recognition;
  recognition.set_verdict(v1::Recognition::CUT_OFF);
  for (const auto& [name, probability] : {std::pair("nut", 0.75), {"ball", 0.125}}) {
    recognition.add_candidates()->set_name(name);
    recognition.mutable_candidates()->rbegin()->set_probability(probability);
  }
  recognition.set_score(0.875);
  recognition.set_presses(3);
  write_recognition(one.writer, header, recognition);
  check_one<dtact_msgs_msg_dds__Recognition_>(one, type, [&](const auto& it) {
    EXPECT_STREQ(it.verdict, "cut_off");
    ASSERT_EQ(it.candidates._length, 2U);
    EXPECT_STREQ(it.candidates._buffer[0], "nut");
    EXPECT_STREQ(it.candidates._buffer[1], "ball");
    ASSERT_EQ(it.probabilities._length, 2U);
    EXPECT_EQ(it.probabilities._buffer[0], 0.75);
    EXPECT_EQ(it.probabilities._buffer[1], 0.125);
    EXPECT_EQ(it.score, 0.875);
    EXPECT_EQ(it.presses, 3U);
  });
}

TEST_F(DdsMessages, AClockMapping) {
  const auto& type = dtact_msgs_msg_dds__ClockMapping__desc;
  const Topic one = topic(type);
  write_clock(one.writer, header, {1, 20, 300, -4000}, v1::TIMESTAMP_START_OF_EXPOSURE);
  check_one<dtact_msgs_msg_dds__ClockMapping_>(one, type, [&](const auto& it) {
    EXPECT_EQ(it.offset_ns, 20);
    EXPECT_EQ(it.error_ns, 300);
    EXPECT_EQ(it.daemon_wall_ahead_ns, -4000);
    EXPECT_STREQ(it.stamp_meaning, "start_of_exposure");
  });
  write_clock(one.writer, header, {}, v1::TIMESTAMP_UNSPECIFIED);
  check_one<dtact_msgs_msg_dds__ClockMapping_>(
      one, type, [&](const auto& it) { EXPECT_STREQ(it.stamp_meaning, ""); });
}

// x of the link points from the gel to the object, which is z of the surface; z of the link is up,
// which is −y of the surface.
TEST_F(DdsMessages, TheSurfacesFrameInTheLinks) {
  const auto& type = tf2_msgs_msg_dds__TFMessage__desc;
  const Topic one = topic(type);
  write_transforms(one.writer, header.stamp_ns, {"left", "right"});
  check_one<tf2_msgs_msg_dds__TFMessage_>(one, type, [&](const auto& it) {
    ASSERT_EQ(it.transforms._length, 2U);
    EXPECT_STREQ(it.transforms._buffer[0].header.frame_id, "left_link");
    EXPECT_STREQ(it.transforms._buffer[1].child_frame_id, "right_surface_optical");
    const auto& q = it.transforms._buffer[1].transform.rotation;
    // The surface's z and y in the link, the last two columns of the rotation.
    EXPECT_NEAR(2 * (q.x * q.z + q.w * q.y), 1, 1e-12);
    EXPECT_NEAR(2 * (q.y * q.z + q.w * q.x), -1, 1e-12);
    EXPECT_NEAR(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w, 1, 1e-12);
  });
}

TEST_F(DdsMessages, PointsInContactOrAll) {
  const auto& type = sensor_msgs_msg_dds__PointCloud2__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  frame.mutable_contact()->set_in_contact(true);
  frame.mutable_contact()->set_threshold_mm(0.2);
  auto& map = *frame.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(3);
  map.set_height(2);
  map.set_full_width(3);
  map.set_full_height(2);
  map.set_mm_per_px(0.5);
  map.set_um_per_unit(100);
  map.set_untrusted_value(-1);
  // 0, 0.1, 0.2 mm above 0.1, 0.2 and 0.3 mm.
  map.set_data(std::string("\0\0\x01\0\x02\0\x01\0\x02\0\x03\0", 12));
  const auto rows_of = [](const sensor_msgs_msg_dds__PointCloud2_& cloud) {
    EXPECT_EQ(cloud.height, 1U);
    EXPECT_EQ(cloud.point_step, 28U);
    EXPECT_EQ(cloud.row_step, 28 * cloud.width);
    EXPECT_EQ(cloud.data._length, 28 * cloud.width);
    std::vector<std::array<float, 7>> rows(cloud.width);
    std::memcpy(rows.data(), cloud.data._buffer, cloud.data._length);
    return rows;
  };
  PointWriter writer;
  writer.write(one.writer, header, frame, false);
  check_one<sensor_msgs_msg_dds__PointCloud2_>(one, type, [&](const auto& cloud) {
    const auto rows = rows_of(cloud);
    ASSERT_EQ(rows.size(), 3U) << "0.2 mm is in contact";
    const auto is = [](const std::array<float, 7>& row, double x_mm, double y_mm, double deep_mm) {
      EXPECT_NEAR(row[0], 1e-3 * x_mm, 1e-9);
      EXPECT_NEAR(row[1], 1e-3 * y_mm, 1e-9);
      EXPECT_NEAR(row[2], -1e-3 * deep_mm, 1e-9);
      EXPECT_NEAR(std::hypot(row[3], row[4], row[5]), 1, 1e-6);
      EXPECT_NEAR(row[6], 1e-3 * deep_mm, 1e-9);
    };
    is(rows[0], 0.5, -0.25, 0.2);
    is(rows[1], 0, 0.25, 0.2);
    is(rows[2], 0.5, 0.25, 0.3);
  });
  writer.write(one.writer, header, frame, true);
  check_one<sensor_msgs_msg_dds__PointCloud2_>(
      one, type, [&](const auto& cloud) { EXPECT_EQ(rows_of(cloud).size(), 6U); });
  frame.mutable_contact()->set_in_contact(false);
  writer.write(one.writer, header, frame, false);
  check_one<sensor_msgs_msg_dds__PointCloud2_>(
      one, type, [&](const auto& cloud) { EXPECT_EQ(rows_of(cloud).size(), 0U); });
}

}  // namespace
}  // namespace dtact::dds
