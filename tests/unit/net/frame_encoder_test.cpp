#include "daemon/net/frame_encoder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/dtact.pb.h"
#include "tests/unit/net/fake_port.hpp"

namespace dtact::net {
namespace {

using test::make_frame;
using testing::ElementsAre;

/// int16, delta + zstd or none; grey or none.
FrameKind kind(int depth, int luma) { return {.depth = depth, .luma = luma}; }

std::vector<int> bytes_of(const std::uint8_t* data, std::size_t size) {
  return {data, data + size};
}

// By hand: length, tag 0x12 (ServerMessage.frame), varint size; tag 0x68 (Frame.dropped), varint.
TEST(FrameEnvelope, WithoutDrops) {
  const FrameEnvelope envelope(5, 0);
  EXPECT_THAT(bytes_of(envelope.head.data(), envelope.head_size), ElementsAre(0, 0, 0, 7, 0x12, 5));
  EXPECT_EQ(envelope.tail_size, 0U);
}

TEST(FrameEnvelope, WithDrops) {
  const FrameEnvelope envelope(125, 300);
  EXPECT_THAT(bytes_of(envelope.head.data(), envelope.head_size),
              ElementsAre(0, 0, 0, 131, 0x12, 0x80, 0x01));
  EXPECT_THAT(bytes_of(envelope.tail.data(), envelope.tail_size), ElementsAre(0x68, 0xac, 0x02));
}

TEST(FrameEnvelope, HoldsTheGreatestNumbers) {
  const FrameEnvelope envelope((16U << 20U) - 64, UINT64_MAX);
  EXPECT_EQ(envelope.head_size, 9U);
  EXPECT_EQ(envelope.tail_size, 11U);
}

TEST(FrameEncoder, GivesEveryoneTheSameBuffer) {
  FrameEncoder encoder("f");
  const auto frame = make_frame(1);
  encoder.begin(frame);
  const auto first = encoder.encode(kind(1, 0));
  EXPECT_EQ(encoder.encode(kind(1, 0)), first);
  EXPECT_NE(encoder.encode(kind(1, 1)), first);
  EXPECT_NE(encoder.encode(kind(0, 0)), first);
}

TEST(FrameEncoder, KeepsBuffersThatAreStillHeld) {
  FrameEncoder encoder("f");
  const auto one = make_frame(1);
  encoder.begin(one);
  const auto held = encoder.encode(kind(1, 0));
  const std::string before = held->body;
  for (std::uint64_t i = 2; i < 50; ++i) {
    const auto frame = make_frame(i);
    encoder.begin(frame);
    ASSERT_NE(encoder.encode(kind(1, 0)), held);
  }
  EXPECT_EQ(held->body, before);
}

TEST(FrameEncoder, AddsItsOwnTimeToTheOthers) {
  FrameEncoder encoder("f");
  auto frame = make_frame(1, 800, 600);
  frame.times.smooth_ns = 400;
  frame.times.decode_ns = std::int64_t{1} << 40U;  // more than the wire holds
  frame.times.list_ns = -1;
  encoder.begin(frame);
  v1::Frame message;
  ASSERT_TRUE(message.ParseFromString(encoder.encode(kind(1, 0))->body));
  EXPECT_EQ(message.times().smooth_ns(), 400U);
  EXPECT_EQ(message.times().decode_ns(), 4294967295U);
  EXPECT_EQ(message.times().list_ns(), 0U);
  EXPECT_GT(message.times().encode_ns(), 0U);
}

TEST(FrameEncoder, CarriesTimesLightAndHealth) {
  FrameEncoder encoder("f");
  auto frame = make_frame(3);
  frame.camera.timestamp_ns = 10;
  frame.camera.ready_ns = 11;
  frame.camera.meaning = hal::TimestampMeaning::start_of_exposure;
  frame.done_ns = 12;
  frame.wall_ns = 13;
  frame.light.brightness = 128;
  frame.health.set(pipeline::Health::starting);
  frame.health.set(pipeline::Health::frames_lost);
  encoder.begin(frame);
  v1::Frame message;
  ASSERT_TRUE(message.ParseFromString(encoder.encode(kind(0, 0))->body));
  EXPECT_EQ(message.monotonic_ns(), 10);
  EXPECT_EQ(message.ready_ns(), 11);
  EXPECT_EQ(message.meaning(), v1::TIMESTAMP_START_OF_EXPOSURE);
  EXPECT_EQ(message.published_ns(), 12);
  EXPECT_EQ(message.wall_ns(), 13);
  EXPECT_EQ(message.light().brightness(), 128U);
  EXPECT_EQ(message.light().leds_size(), 8);
  EXPECT_THAT(message.health(), ElementsAre(v1::HEALTH_STARTING, v1::HEALTH_FRAMES_LOST));
  EXPECT_FALSE(message.has_depth());
}

TEST(FrameEncoder, RefusesWhatExceedsTheWire) {
  FrameEncoder encoder("f");
  const auto frame = make_frame(1, 4096, 4096);  // 32 MiB of depth, 16 MiB of luma
  encoder.begin(frame);
  EXPECT_EQ(encoder.encode(kind(1, 0)), nullptr);
  EXPECT_EQ(encoder.encode(kind(0, 1)), nullptr);
  EXPECT_NE(encoder.encode(kind(2, 0)), nullptr);  // flat, so it compresses
}

// The cap is 16 MiB; what stands round a body takes 5 bytes before and 11 after it at most.
TEST(FrameEncoder, LeavesRoomForTheEnvelope) {
  FrameEncoder encoder("f");
  pipeline::DepthFrame frame;
  frame.has_luma = true;
  frame.luma_height = 1;
  const auto encode = [&](int pixels) {
    frame.luma_width = pixels;
    frame.luma.resize(static_cast<std::size_t>(pixels));
    encoder.begin(frame);
    return encoder.encode(kind(0, 1));
  };
  constexpr int kLess = 16'700'000;
  const std::size_t rest = encode(kLess)->body.size() - kLess;
  const int cap = 16'777'216 - static_cast<int>(rest);
  EXPECT_NE(encode(cap - 300), nullptr);
  for (int pixels = cap - 300; pixels < cap + 16; pixels += 4) {
    const auto encoded = encode(pixels);
    if (encoded != nullptr) {
      EXPECT_LE(encoded->body.size() + 5 + 11, 16'777'216U) << pixels;
    }
  }
}

}  // namespace
}  // namespace dtact::net
