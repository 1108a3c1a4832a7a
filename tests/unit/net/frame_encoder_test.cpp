#include "daemon/net/frame_encoder.hpp"

#include <gmock/gmock.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

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
  frame.times.lut_ns = -1;
  encoder.begin(frame);
  v1::Frame message;
  ASSERT_TRUE(message.ParseFromString(encoder.encode(kind(1, 0))->body));
  EXPECT_EQ(message.times().smooth_ns(), 400U);
  EXPECT_EQ(message.times().decode_ns(), 4294967295U);
  EXPECT_EQ(message.times().lut_ns(), 0U);
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

TEST(FrameEncoder, SaysTheSurfaceOfASensorThatIsNotFlat) {
  FrameEncoder encoder("f");
  auto frame = make_frame(3);
  v1::Frame message;
  encoder.begin(frame);
  ASSERT_TRUE(message.ParseFromString(encoder.encode(kind(0, 0))->body));
  EXPECT_FALSE(message.has_surface());
  frame.surface = {recon::Surface::Kind::cylinder, 12.5, 90, 20, 8, 1.41};
  encoder.begin(frame);
  ASSERT_TRUE(message.ParseFromString(encoder.encode(kind(0, 0))->body));
  EXPECT_EQ(message.surface().shape(), v1::Surface::CYLINDER);
  EXPECT_EQ(message.surface().radius_mm(), 12.5);
  EXPECT_EQ(message.surface().axis_deg(), 90);
  EXPECT_EQ(message.surface().air_mm(), 20);
  EXPECT_EQ(message.surface().gel_mm(), 8);
  EXPECT_EQ(message.surface().refraction(), 1.41);
}

TEST(FrameEncoder, RefusesWhatExceedsTheWire) {
  FrameEncoder encoder("f");
  const auto frame = make_frame(1, 4096, 4096);  // 32 MiB of depth, 16 MiB of luma
  encoder.begin(frame);
  EXPECT_EQ(encoder.encode(kind(1, 0)), nullptr);
  EXPECT_EQ(encoder.encode(kind(0, 1)), nullptr);
  EXPECT_NE(encoder.encode(kind(2, 0)), nullptr);  // flat, so it compresses
}

// The cap is 16 MiB; the envelope takes at most 5 bytes before a body and 11 after it.
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

/// The field numbers of a message, in their order on the wire.
std::vector<int> fields_of(const std::string& bytes) {
  google::protobuf::io::CodedInputStream in(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                            static_cast<int>(bytes.size()));
  std::vector<int> fields;
  while (const std::uint32_t tag = in.ReadTag()) {
    fields.push_back(static_cast<int>(tag >> 3U));
    EXPECT_TRUE(google::protobuf::internal::WireFormatLite::SkipField(&in, tag));
  }
  return fields;
}

// Some decoders do not merge a message field that comes twice (protobuf.js before 2026).
TEST(FrameEncoder, WritesEveryFieldOnce) {
  FrameEncoder encoder("f");
  auto frame = make_frame(1);
  frame.has_jpeg = true;
  frame.jpeg = {0xff, 0xd8, 0xff, 0xd9};
  frame.health.set(pipeline::Health::starting);
  encoder.begin(frame, 7);
  FrameKind all = kind(1, 1);
  all.jpeg = true;
  auto fields = fields_of(encoder.encode(all)->body);
  EXPECT_EQ(fields.back(), v1::Frame::kTimesFieldNumber) << "what it took is known last";
  std::ranges::sort(fields);
  EXPECT_TRUE(std::ranges::adjacent_find(fields) == fields.end());
}

TEST(FrameEncoder, CarriesWhatIsNewIn11) {
  FrameEncoder encoder("f");
  auto frame = make_frame(3);
  frame.light_since_ns = 77;
  frame.contact.in_contact = true;
  frame.has_jpeg = true;
  frame.jpeg_width = 8;
  frame.jpeg_height = 4;
  frame.jpeg = {0xff, 0xd8, 0xff, 0xd9};
  encoder.begin(frame, 7);
  v1::Frame message;
  ASSERT_TRUE(message.ParseFromString(encoder.encode({.jpeg = true})->body));
  EXPECT_EQ(message.light().since_ns(), 77);
  EXPECT_EQ(message.calibration(), 7U);
  EXPECT_EQ(message.contact_absence(), v1::CONTACT_ABSENCE_NONE);
  EXPECT_TRUE(message.contact().in_contact());
  EXPECT_FALSE(message.contact().has_force_n()) << "not calibrated is not 0 N";
  EXPECT_EQ(message.jpeg().width(), 8U);
  EXPECT_EQ(message.jpeg().height(), 4U);
  EXPECT_EQ(message.jpeg().data(), "\xff\xd8\xff\xd9");
  EXPECT_FALSE(message.has_depth());
  EXPECT_FALSE(message.has_luma());

  frame.contact.force = recon::Force{0, 0.03};
  encoder.begin(frame);
  ASSERT_TRUE(message.ParseFromString(encoder.encode({})->body));
  EXPECT_TRUE(message.contact().has_force_n());
  EXPECT_EQ(message.contact().force_n(), 0);
  EXPECT_EQ(message.contact().force_uncertainty_n(), 0.03);

  frame.light_since_ns.reset();
  frame.contact_absence = pipeline::ContactAbsence::referencing;
  encoder.begin(frame);
  ASSERT_TRUE(message.ParseFromString(encoder.encode({})->body));
  EXPECT_FALSE(message.light().has_since_ns());
  EXPECT_FALSE(message.has_calibration());
  EXPECT_FALSE(message.has_contact()) << "not measured is not nothing pressed";
  EXPECT_EQ(message.contact_absence(), v1::CONTACT_ABSENCE_REFERENCING);
  frame.contact_absence = pipeline::ContactAbsence::uncalibrated;
  encoder.begin(frame);
  ASSERT_TRUE(message.ParseFromString(encoder.encode({})->body));
  EXPECT_EQ(message.contact_absence(), v1::CONTACT_ABSENCE_UNCALIBRATED);
  frame.contact_absence = pipeline::ContactAbsence::unasked;
  encoder.begin(frame);
  ASSERT_TRUE(message.ParseFromString(encoder.encode({})->body));
  EXPECT_EQ(message.contact_absence(), v1::CONTACT_ABSENCE_UNASKED);
}

TEST(FrameEncoder, MakesTheMapThatIsAskedFor) {
  FrameEncoder encoder("f");
  auto frame = make_frame(1);  // 8×4
  for (std::size_t i = 0; i < frame.depth_um.size(); ++i) {
    frame.depth_um[i] = static_cast<std::int16_t>(10 * i);
  }
  encoder.begin(frame);
  FrameKind asked = kind(v1::DEPTH_INT16, 0);
  asked.spec = {.decimation = 2, .um_per_unit = 5, .region = DepthRegion{2, 1, 3, 2}};
  v1::Frame message;
  ASSERT_TRUE(message.ParseFromString(encoder.encode(asked)->body));
  const auto& depth = message.depth();
  EXPECT_EQ(depth.decimation(), 2U);
  EXPECT_EQ(depth.um_per_unit(), 5.0);
  EXPECT_EQ(depth.mm_per_px(), 0.1);
  EXPECT_EQ(depth.x(), 1U);
  EXPECT_EQ(depth.y(), 0U);
  EXPECT_EQ(depth.width(), 2U);
  EXPECT_EQ(depth.height(), 2U);
  EXPECT_EQ(depth.full_width(), 4U);
  EXPECT_EQ(depth.full_height(), 2U);
  // Means of 20 30 100 110, 40 50 120 130, 180 190 260 270 and 200 210 280 290, by 5.
  EXPECT_EQ(depth.data(), std::string("\x0d\0\x11\0\x2d\0\x31\0", 8));
}

TEST(FrameEncoder, SaysHowAMapWasMade) {
  FrameEncoder encoder("f");
  auto frame = make_frame(1);
  frame.sharpen_steps = 2;
  frame.made_decimation = 4;
  encoder.begin(frame);
  v1::Frame message;
  ASSERT_TRUE(message.ParseFromString(encoder.encode(kind(v1::DEPTH_INT16, 0))->body));
  EXPECT_EQ(message.depth().sharpen_steps(), 2U);
  EXPECT_EQ(message.depth().made_decimation(), 4U);
  EXPECT_EQ(message.depth().decimation(), 1U);
  FrameKind coarse = kind(v1::DEPTH_INT16, 0);
  coarse.spec.decimation = 4;
  ASSERT_TRUE(message.ParseFromString(encoder.encode(coarse)->body));
  EXPECT_EQ(message.depth().sharpen_steps(), 2U);
  EXPECT_EQ(message.depth().made_decimation(), 0U) << "no finer than it was made";
}

TEST(FrameEncoder, OfTheContactsBoxSendsNoMapWithoutContact) {
  FrameEncoder encoder("f");
  auto frame = make_frame(1, 100, 80);
  frame.contact_um = 100;
  FrameKind asked = kind(v1::DEPTH_PREDICT_ZSTD, 0);
  asked.contact_box = true;
  encoder.begin(frame);
  v1::Frame message;
  ASSERT_TRUE(message.ParseFromString(encoder.encode(asked)->body));
  EXPECT_FALSE(message.has_depth());
  EXPECT_TRUE(message.has_contact());
  frame.contact.in_contact = true;
  frame.depth_um[30 * 100 + 40] = 500;
  encoder.begin(frame);
  ASSERT_TRUE(message.ParseFromString(encoder.encode(asked)->body));
  EXPECT_EQ(message.depth().encoding(), v1::DEPTH_PREDICT_ZSTD);
  EXPECT_EQ(message.depth().x(), 24U);
  EXPECT_EQ(message.depth().y(), 14U);
  EXPECT_EQ(message.depth().width(), 33U);
  EXPECT_EQ(message.depth().height(), 33U);
  EXPECT_EQ(message.depth().full_width(), 100U);
}

TEST(FrameEncoder, SharesWhatIsTheSameWhicheverOrderItIsAskedFor) {
  FrameEncoder encoder("f");
  const auto frame = make_frame(1, 64, 64);
  FrameKind halved = kind(v1::DEPTH_INT16, 0);
  halved.spec.decimation = 2;
  FrameKind packed = halved;
  packed.depth = v1::DEPTH_PREDICT_ZSTD;
  FrameKind with_luma = halved;
  with_luma.luma = 1;
  for (int round = 0; round < 3; ++round) {
    encoder.begin(frame);
    v1::Frame first;
    v1::Frame second;
    v1::Frame whole;
    v1::Frame third;
    ASSERT_TRUE(first.ParseFromString(encoder.encode(halved)->body));
    ASSERT_TRUE(whole.ParseFromString(encoder.encode(kind(1, 0))->body));
    ASSERT_TRUE(second.ParseFromString(encoder.encode(packed)->body));
    ASSERT_TRUE(third.ParseFromString(encoder.encode(with_luma)->body));
    EXPECT_EQ(first.depth().SerializeAsString(), third.depth().SerializeAsString());
    EXPECT_EQ(second.depth().encoding(), v1::DEPTH_PREDICT_ZSTD);
    EXPECT_EQ(second.depth().width(), 32U);
    EXPECT_EQ(whole.depth().width(), 64U);
    EXPECT_EQ(third.luma().width(), 64U);
  }
  EXPECT_EQ(encoder.times().count(), 12U);
}

}  // namespace
}  // namespace dtact::net
