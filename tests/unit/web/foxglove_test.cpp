// Foxglove's protocol, byte for byte.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/cpp/errors.hpp"
#include "clients/recording/foxglove.pb.h"
#include "clients/web/foxglove/protocol.hpp"
#include "clients/web/token_query.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::web::foxglove {
namespace {

using namespace std::string_literals;

TEST(FoxgloveProtocol, Heads) {
  EXPECT_EQ(message_head(0x04030201, 0x0c0b0a0908070605),
            "\x01\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b\x0c"s);
  EXPECT_EQ(service_response(2, 3, "{}"), "\x03\x02\0\0\0\x03\0\0\0\x04\0\0\0json{}"s);
  EXPECT_EQ(service_failure(2, 3, "no \"x\"\n"),
            R"({"op":"serviceCallFailure","serviceId":2,"callId":3,"message":"no \"x\"\u000a"})");
  EXPECT_EQ(status(2, "a"), R"({"op":"status","level":2,"message":"a"})");
  EXPECT_EQ(status(1, "a", "left"), R"({"op":"status","level":1,"message":"a","id":"left"})");
  EXPECT_EQ(remove_status("left"), R"({"op":"removeStatus","statusIds":["left"]})");
}

// Two schemas of one name are an error to Foxglove.
TEST(FoxgloveProtocol, RequestAndResponseHaveSchemasOfTheirOwn) {
  const std::string services = advertise_services(0, {"/left"});
  for (const char* name : {"dtact.v1.SetLight_Request", "dtact.v1.SetLight_Response",
                           "dtact.v1.Rezero_Request", "dtact.v1.Rezero_Response"}) {
    const std::string quoted = fmt::format(R"("schemaName":"{}")", name);
    EXPECT_THAT(services, testing::HasSubstr(quoted));
    EXPECT_EQ(services.find(quoted), services.rfind(quoted)) << name;
  }
}

TEST(FoxgloveProtocol, IdsAreAlikeForNoTwo) {
  EXPECT_EQ(channel_id(0, Topic::frame), 1U);
  EXPECT_EQ(channel_id(0, Topic::jpeg), 8U);
  EXPECT_EQ(channel_id(1, Topic::frame), 13U);
  EXPECT_EQ(service_id(0, Service::rezero), 2U);
  EXPECT_EQ(service_id(1, Service::set_light), 3U);
  for (std::size_t i = 0; i < kTopics; ++i) EXPECT_EQ(index(topics()[i].topic), i);
}

TEST(FoxgloveProtocol, Operations) {
  const auto subscribe = parse_operation(
      R"({"op":"subscribe","subscriptions":[{"id":4294967295,"channelId":7},{"id":-1,"channelId":2},)"
      R"({"id":1.5,"channelId":2},{"id":"x","channelId":2},{"id":3}]})");
  ASSERT_TRUE(subscribe);
  EXPECT_EQ(subscribe->name, "subscribe");
  ASSERT_EQ(subscribe->subscribed.size(), 1U);
  EXPECT_EQ(subscribe->subscribed[0].subscription, 4294967295U);
  EXPECT_EQ(subscribe->subscribed[0].channel, 7U);
  const auto unsubscribe = parse_operation(R"({"op":"unsubscribe","subscriptionIds":[3,"x",4]})");
  ASSERT_TRUE(unsubscribe);
  EXPECT_THAT(unsubscribe->ended, testing::ElementsAre(3U, 4U));
  for (const char* text : {"", "[]", "3", "{", R"({"op":3})", R"({"x":"subscribe"})"}) {
    EXPECT_FALSE(parse_operation(text)) << text;
  }
}

TEST(FoxgloveProtocol, Calls) {
  const std::string bytes = "\x02\x01\0\0\0\x09\0\0\0\x04\0\0\0json{}"s;
  const auto call = parse_call(bytes);
  ASSERT_TRUE(call);
  EXPECT_EQ(call->service, 1U);
  EXPECT_EQ(call->call, 9U);
  EXPECT_EQ(call->encoding, "json");
  EXPECT_EQ(call->payload, "{}");
  for (std::size_t size = 0; size < 17; ++size) {
    EXPECT_FALSE(parse_call(std::string_view(bytes).substr(0, size))) << size;
  }
  EXPECT_FALSE(parse_call("\x01\x01\0\0\0\x09\0\0\0\0\0\0\0"s));
}

TEST(FoxgloveProtocol, Requests) {
  const auto light = request_of(Service::set_light, R"({"brightness":3,"leds":[{"r":255}]})");
  EXPECT_EQ(light.set_light().brightness(), 3U);
  EXPECT_EQ(light.set_light().leds(0).r(), 255U);
  EXPECT_TRUE(request_of(Service::rezero, R"({"force":true})").rezero().force());
  EXPECT_TRUE(request_of(Service::rezero, "").has_rezero());
  EXPECT_THROW((void)request_of(Service::set_light, R"({"brightnes":3})"), std::runtime_error);
  EXPECT_THROW((void)request_of(Service::set_light, R"({"brightness":-1})"), std::runtime_error);
}

TEST(FoxgloveTopics, AskForNoMoreThanIsWanted) {
  EXPECT_EQ(subscription_for({}).SerializeAsString(), "");
  Topics wanted;
  wanted.set(index(Topic::event));
  EXPECT_EQ(subscription_for(wanted).SerializeAsString(), "");
  wanted.set(index(Topic::depth));
  EXPECT_EQ(subscription_for(wanted).ShortDebugString(), "depth: DEPTH_INT16 depth_hz: 60");
  wanted.set(index(Topic::frame));
  EXPECT_EQ(subscription_for(wanted).ShortDebugString(),
            "depth: DEPTH_PREDICT_ZSTD summary: true depth_hz: 60 summary_hz: 60");
}

TEST(FoxgloveTopics, APictureOfDepth) {
  v1::Frame frame;
  frame.set_wall_ns(1'000'000'002);
  frame.set_frame_id("dtact_surface");
  auto& map = *frame.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(2);
  map.set_height(2);
  map.set_um_per_unit(2);
  map.set_untrusted_value(-32768);
  map.set_data("\x01\0\xff\xff\0\x80\x34\x12"s);  // 1, -1, untrusted, 0x1234
  const auto message = message_of(Topic::depth, frame);
  ASSERT_NE(message, nullptr);
  EXPECT_EQ(message->time_ns, 1'000'000'002U);
  ::foxglove::RawImage image;
  ASSERT_TRUE(image.ParseFromString(message->payload));
  EXPECT_EQ(image.data(), "\x02\0\0\0\0\0\x68\x24"s);
  EXPECT_EQ(image.step(), 4U);
  EXPECT_EQ(image.timestamp().nanos(), 2);
  EXPECT_EQ(message_of(Topic::luma, frame), nullptr);
  EXPECT_EQ(message_of(Topic::contact, frame), nullptr);
  map.set_um_per_unit(std::numeric_limits<double>::quiet_NaN());  // of another's daemon
  ASSERT_TRUE(image.ParseFromString(message_of(Topic::depth, frame)->payload));
  EXPECT_EQ(image.data(), std::string(8, '\0'));
}

TEST(FoxgloveTopics, ACloudOfThePointsThatAreThere) {
  v1::Frame frame;
  frame.set_frame_id("dtact_surface");
  auto& cloud = *frame.mutable_cloud();
  cloud.set_encoding(v1::CLOUD_FLOAT32);
  cloud.set_width(2);
  cloud.set_height(1);
  cloud.set_points(1);
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  const std::array<float, 12> values{kNone, 1, kNone, 2, kNone, 3, kNone, 0, kNone, 0, kNone, -1};
  cloud.set_data(values.data(), sizeof values);
  const auto message = message_of(Topic::points, frame);
  ASSERT_NE(message, nullptr);
  ::foxglove::PointCloud points;
  ASSERT_TRUE(points.ParseFromString(message->payload));
  EXPECT_EQ(points.frame_id(), "dtact_surface");
  EXPECT_EQ(points.point_stride(), 24U);
  ASSERT_EQ(points.fields_size(), 6);
  EXPECT_EQ(points.fields(5).name(), "normal_z");
  EXPECT_EQ(points.fields(5).offset(), 20U);
  std::array<float, 6> point{};
  ASSERT_EQ(points.data().size(), sizeof point);
  std::memcpy(point.data(), points.data().data(), sizeof point);
  EXPECT_THAT(point, testing::ElementsAre(1, 2, 3, 0, 0, -1));
  cloud.mutable_data()->pop_back();
  EXPECT_THROW((void)message_of(Topic::points, frame), client::ProtocolError);
}

TEST(FoxgloveTopics, ACloudWhoseNumbersDoNotFitItsDataIsRefused) {
  v1::Frame frame;
  auto& cloud = *frame.mutable_cloud();
  cloud.set_encoding(v1::CLOUD_FLOAT32);
  cloud.set_width(1);
  cloud.set_height(1);
  cloud.set_data(std::string(24, '\0'));
  cloud.set_points(UINT32_MAX);  // 100 GB of them
  EXPECT_THROW((void)message_of(Topic::points, frame), client::ProtocolError);
  cloud.set_points(0);
  cloud.set_data("");
  cloud.set_width(1U << 31U);  // 24 * 2^62 is 0 in 64 bits
  cloud.set_height(1U << 31U);
  EXPECT_THROW((void)message_of(Topic::points, frame), client::ProtocolError);
}

TEST(FoxgloveTopics, NoPointsAreACloudToo) {
  v1::Frame frame;
  frame.set_wall_ns(1'000'000'002);
  frame.set_frame_id("dtact_surface");
  EXPECT_EQ(message_of(Topic::points, frame), nullptr);
  ::foxglove::PointCloud points;
  ASSERT_TRUE(points.ParseFromString(points_of(frame)->payload));
  EXPECT_EQ(points.frame_id(), "dtact_surface");
  EXPECT_EQ(points.timestamp().nanos(), 2);
  EXPECT_EQ(points.point_stride(), 24U);
  EXPECT_EQ(points.fields_size(), 6);
  EXPECT_EQ(points.data(), "");
}

TEST(FoxgloveTopics, ThePoseOfTheObject) {
  v1::Frame frame;
  frame.set_frame_id("dtact_surface");
  auto& pose = *frame.mutable_pose();
  pose.mutable_translation_mm()->set_x(1.5);
  pose.mutable_translation_mm()->set_z(-0.5);
  pose.mutable_rotation_deg()->set_y(-90);
  EXPECT_EQ(message_of(Topic::pose, frame), nullptr) << "it is not known";
  pose.set_valid(true);
  ::foxglove::PoseInFrame in_frame;
  ASSERT_TRUE(in_frame.ParseFromString(message_of(Topic::pose, frame)->payload));
  EXPECT_EQ(in_frame.frame_id(), "dtact_surface");
  EXPECT_DOUBLE_EQ(in_frame.pose().position().x(), 0.0015);
  EXPECT_DOUBLE_EQ(in_frame.pose().position().z(), -0.0005);
  EXPECT_NEAR(in_frame.pose().orientation().y(), -0.70710678, 1e-8);
  EXPECT_NEAR(in_frame.pose().orientation().w(), 0.70710678, 1e-8);
  EXPECT_EQ(in_frame.pose().orientation().x(), 0);
  ::foxglove::FrameTransforms transforms;
  ASSERT_TRUE(transforms.ParseFromString(message_of(Topic::transforms, frame)->payload));
  ASSERT_EQ(transforms.transforms_size(), 1);
  EXPECT_EQ(transforms.transforms(0).parent_frame_id(), "dtact_surface");
  EXPECT_EQ(transforms.transforms(0).child_frame_id(), "dtact_surface_object");
  EXPECT_NEAR(transforms.transforms(0).rotation().y(), -0.70710678, 1e-8);
  pose.clear_rotation_deg();
  ASSERT_TRUE(in_frame.ParseFromString(message_of(Topic::pose, frame)->payload));
  EXPECT_EQ(in_frame.pose().orientation().w(), 1);
}

TEST(FoxgloveTopics, WhatTheObjectIs) {
  v1::Frame frame;
  EXPECT_EQ(message_of(Topic::recognition, frame), nullptr);
  frame.mutable_recognition()->set_verdict(v1::Recognition::UNKNOWN);
  v1::Recognition recognition;
  ASSERT_TRUE(recognition.ParseFromString(message_of(Topic::recognition, frame)->payload));
  EXPECT_EQ(recognition.verdict(), v1::Recognition::UNKNOWN);
}

void collect_strings(const google::protobuf::Value& value, std::vector<std::string>& all) {
  if (value.has_string_value()) all.push_back(value.string_value());
  for (const auto& one : value.list_value().values()) collect_strings(one, all);
  for (const auto& [key, one] : value.struct_value().fields()) {
    all.push_back(key);
    collect_strings(one, all);
  }
}

TEST(FoxgloveLayouts, HaveTitlesForBothProgramsAndTopicsThatAreServed) {
  for (const char* file :
       {"clients/recording/foxglove-layout.json", "config/foxglove/dtact-live.json",
        "config/foxglove/dtact-points.json"}) {
    google::protobuf::Struct layout;
    const std::string path = std::string(DTACT_SOURCE_DIR) + "/" + file;
    ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(base::read_file(path), &layout).ok());
    for (const auto& [name, panel] : layout.fields().at("configById").struct_value().fields()) {
      const auto& settings = panel.struct_value().fields();
      EXPECT_EQ(settings.at("foxglovePanelTitle").string_value(),
                settings.at("lichtblickPanelTitle").string_value())
          << name;
      std::vector<std::string> strings;
      collect_strings(panel, strings);
      for (const std::string& text : strings) {
        if (!text.starts_with("/")) continue;
        const std::string topic = text.substr(0, text.find('.'));
        const bool service = topic == "/dtact/set_light" || topic == "/dtact/rezero";
        EXPECT_TRUE(service || std::ranges::any_of(
                                   topics(), [&](const TopicInfo& i) { return i.name == topic; }))
            << file << ": " << text;
      }
    }
  }
}

TEST(FoxgloveTopics, AreThoseThatTheDaemonServes) {
  EXPECT_EQ(served_by(std::nullopt).count(), kTopics - 4);
  EXPECT_FALSE(served_by(v1::HelloReply()).test(index(Topic::points)));
  v1::HelloReply perceive;
  perceive.add_features("cloud");
  EXPECT_EQ(served_by(perceive).count(), 6U);
  EXPECT_TRUE(served_by(perceive).test(index(Topic::points)));
  Topics wanted;
  wanted.set(index(Topic::points));
  EXPECT_EQ(subscription_for(wanted).ShortDebugString(),
            "summary: true summary_hz: 60 decimation: 2 contact_box: true cloud: CLOUD_FLOAT32 "
            "cloud_hz: 60");
  EXPECT_EQ(unadvertise({{1, "/left", wanted}}), R"({"op":"unadvertise","channelIds":[21]})");
  wanted.reset().set(index(Topic::transforms));
  EXPECT_EQ(subscription_for(wanted).ShortDebugString(), "pose: true pose_hz: 60");
  wanted.reset().set(index(Topic::recognition));
  EXPECT_EQ(subscription_for(wanted).ShortDebugString(), "recognition: true recognition_hz: 60");
}

TEST(FoxgloveEndpoint, ATokenInTheAddress) {
  EXPECT_EQ(token_of("/foxglove"), "");
  EXPECT_EQ(token_of("/foxglove?token=abc"), "abc");
  EXPECT_EQ(token_of("/foxglove?x=1&token=a%2Bb%&y"), "a+b%");
  EXPECT_EQ(token_of("/foxglove?mytoken=abc"), "");
}

}  // namespace
}  // namespace dtact::web::foxglove
