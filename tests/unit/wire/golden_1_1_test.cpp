// The bytes of version 1.1, frozen: what came with it stays as it is. By protoc --encode, which
// shares no code with the daemon's writing of frames.
#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "proto/dtact.pb.h"

namespace dtact::v1 {
namespace {

std::string hex_of(const std::string& bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string hex;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    if (!hex.empty()) hex += ' ';
    hex += kDigits[byte >> 4U];
    hex += kDigits[byte & 15U];
  }
  return hex;
}

/// The message of this text has these bytes, and the bytes are read as this message.
template <typename Message>
void expect_golden(const std::string& text, const std::string& hex) {
  Message message;
  ASSERT_TRUE(google::protobuf::TextFormat::ParseFromString(text, &message));
  EXPECT_EQ(hex_of(message.SerializeAsString()), hex);
  Message read;
  ASSERT_TRUE(read.ParseFromString(message.SerializeAsString()));
  EXPECT_EQ(read.ShortDebugString(), message.ShortDebugString());
}

TEST(Golden11, Subscribe) {
  expect_golden<ClientMessage>(
      R"(id: 2 subscribe { depth: DEPTH_RVL luma: LUMA_GREY8 every: 3 summary: true jpeg: true )"
      R"(depth_hz: 30 luma_hz: 0.5 jpeg_hz: 1 summary_hz: 60 decimation: 2 um_per_unit: 5 box )"
      R"({ x: 1 y: 2 width: 3 height: 4 } events: false })",
      "08 02 1a 3e 08 03 10 01 18 03 20 01 28 01 31 00 00 00 00 00 00 3e 40 39 00 00 00 00 "
      "00 00 e0 3f 41 00 00 00 00 00 00 f0 3f 49 00 00 00 00 00 00 4e 40 50 02 58 05 62 08 "
      "08 01 10 02 18 03 20 04 70 00");
}

TEST(Golden11, SubscribeToTheContactsBox) {
  expect_golden<ClientMessage>(
      R"(id: 2 subscribe { depth: DEPTH_PREDICT_ZSTD contact_box: true events: true })",
      "08 02 1a 06 08 04 68 01 70 01");
}

TEST(Golden11, GetReference) {
  expect_golden<ClientMessage>(R"(id: 4 get_reference {})", "08 04 5a 00");
}

TEST(Golden11, Ping) { expect_golden<ClientMessage>(R"(id: 4 ping {})", "08 04 62 00"); }

TEST(Golden11, Hello) {
  expect_golden<ClientMessage>(R"(id: 1 hello { major: 1 minor: 1 program: "x" token: "t" })",
                               "08 01 12 0a 08 01 10 01 1a 01 78 22 01 74");
}

TEST(Golden11, HelloReply) {
  expect_golden<ServerMessage>(
      R"(reply { id: 9 hello { major: 1 minor: 1 program: "d" features: "rvl" features: "ping" )"
      R"(rights: RIGHTS_VIEW name: "n" serial: "s" } })",
      "0a 1e 08 09 1a 1a 08 01 10 01 1a 01 64 2a 03 72 76 6c 2a 04 70 69 6e 67 30 01 3a 01 "
      "6e 42 01 73");
}

TEST(Golden11, Reference) {
  expect_golden<ServerMessage>(
      R"(reply { id: 9 reference { png: "p" light { brightness: 7 since_ns: 8 } sequence: 5 )"
      R"(calibration: 0 } })",
      "0a 11 08 09 4a 0d 0a 01 70 12 04 08 07 18 10 18 05 20 00");
}

TEST(Golden11, Pong) {
  expect_golden<ServerMessage>(R"(reply { id: 9 pong { monotonic_ns: 1 wall_ns: 2 } })",
                               "0a 08 08 09 52 04 08 02 10 04");
}

TEST(Golden11, Unsupported) {
  expect_golden<ServerMessage>(R"(reply { id: 9 error { code: ERROR_UNSUPPORTED message: "m" } })",
                               "0a 09 08 09 12 05 08 0a 12 01 6d");
}

TEST(Golden11, Status) {
  expect_golden<ServerMessage>(
      R"(reply { id: 9 status { state: STATE_SERVING clients { address: "a" program: "p" sent: )"
      R"(1 dropped: 2 rights: RIGHTS_CONTROL endpoint: "e" sent_bytes: 3 waiting_bytes: 4 } )"
      R"(endpoints { address: "a" tls: true token: true insecure: true fingerprint: "f" } )"
      R"(name: "n" serial: "s" } })",
      "0a 32 08 09 32 2e 08 03 6a 13 0a 01 61 12 01 70 18 01 20 02 28 02 32 01 65 38 03 40 "
      "04 9a 01 0c 0a 01 61 10 01 18 01 20 01 2a 01 66 a2 01 01 6e aa 01 01 73");
}

TEST(Golden11, LightEvent) {
  expect_golden<ServerMessage>(
      R"(event { light { brightness: 7 since_ns: -1 } sequence: 1 monotonic_ns: 2 wall_ns: 3 })",
      "1a 0c 12 04 08 07 18 01 30 01 38 04 40 06");
}

TEST(Golden11, CalibrationEvent) {
  expect_golden<ServerMessage>(
      R"(event { calibration { name: "n" number: 0 } sequence: 1 monotonic_ns: 2 wall_ns: 3 })",
      "1a 0d 2a 05 0a 01 6e 10 00 30 01 38 04 40 06");
}

TEST(Golden11, FrameWithEveryField) {
  expect_golden<ServerMessage>(
      R"(frame { sequence: 1 monotonic_ns: 2 wall_ns: 3 meaning: TIMESTAMP_FIRST_PACKET )"
      R"(ready_ns: 4 published_ns: 5 health: HEALTH_LIGHT_UNSETTLED health: )"
      R"(HEALTH_EXPOSURE_FOLLOWS light { brightness: 128 leds { r: 1 g: 2 b: 3 } since_ns: 6 } )"
      R"(contact { touching: true area_mm2: 1 x_mm: 2 y_mm: 3 deepest_mm: 4 deepest_x_mm: 5 )"
      R"(deepest_y_mm: 6 volume_mm3: 7 } times { decode_ns: 1 rectify_ns: 2 smooth_ns: 3 )"
      R"(list_ns: 4 inspect_ns: 5 encode_ns: 6 activity_ns: 7 publish_ns: 8 } depth { )"
      R"(encoding: DEPTH_INT16 width: 2 height: 1 mm_per_px: 0.5 um_per_unit: 5 )"
      R"(untrusted_value: -32768 data: "\001\000\377\377" decimation: 2 uncertainty_um: 16 x: )"
      R"(3 y: 4 full_width: 290 full_height: 290 } luma { encoding: LUMA_GREY8 width: 2 )"
      R"(height: 1 data: "\n\013" } dropped: 300 frame_id: "f" contact_absence: )"
      R"(CONTACT_ABSENCE_REFERENCING calibration: 0 jpeg { width: 2 height: 1 data: )"
      R"("\377\330\377\331" } })",
      "12 d1 01 08 01 10 04 18 06 20 04 28 08 30 0a 3a 02 03 15 42 0d 08 80 01 12 06 08 01 "
      "10 02 18 03 18 0c 4a 41 08 01 11 00 00 00 00 00 00 f0 3f 19 00 00 00 00 00 00 00 40 "
      "21 00 00 00 00 00 00 08 40 29 00 00 00 00 00 00 10 40 31 00 00 00 00 00 00 14 40 39 "
      "00 00 00 00 00 00 18 40 41 00 00 00 00 00 00 1c 40 52 10 08 01 10 02 18 03 20 04 28 "
      "05 30 06 38 07 40 08 5a 37 08 01 10 02 18 01 21 00 00 00 00 00 00 e0 3f 29 00 00 00 "
      "00 00 00 14 40 30 ff ff 03 3a 04 01 00 ff ff 40 02 49 00 00 00 00 00 00 30 40 50 03 "
      "58 04 60 a2 02 68 a2 02 62 0a 08 01 10 02 18 01 22 02 0a 0b 68 ac 02 72 01 66 78 02 "
      "80 01 00 8a 01 0a 08 02 10 01 1a 04 ff d8 ff d9");
}

TEST(Golden11, ContactWithForce) {
  expect_golden<ServerMessage>(R"(frame { contact { force_n: 1.5 force_uncertainty_n: 0.25 } })",
                               "12 14 4a 12 49 00 00 00 00 00 00 f8 3f 51 00 00 00 00 00 00 d0 3f");
}

TEST(Golden11, ContactWithoutForce) {
  expect_golden<ServerMessage>(R"(frame { contact { force_absence: FORCE_ABSENCE_CUT_OFF } })",
                               "12 04 4a 02 58 03");
}

TEST(Golden11, SetReconstruction) {
  expect_golden<ClientMessage>(
      R"(id: 4 set_reconstruction { resolution: "m" sharpen: "s" max_error_um: 30 })",
      "08 04 6a 0f 0a 01 6d 12 01 73 19 00 00 00 00 00 00 3e 40");
}

TEST(Golden11, SubscribeToPointsAndPose) {
  expect_golden<ClientMessage>(
      R"(id: 2 subscribe { cloud: CLOUD_INT16 cloud_hz: 1 pose: true pose_hz: 30 })",
      "08 02 1a 1a a0 01 02 a9 01 00 00 00 00 00 00 f0 3f b0 01 01 b9 01 00 00 00 00 00 00 "
      "3e 40");
}

TEST(Golden11, Reconstruction) {
  expect_golden<ServerMessage>(
      R"(reply { id: 9 reconstruction { resolution: "m" sharpen: "s" max_error_um: 1 } })",
      "0a 13 08 09 5a 0f 0a 01 6d 12 01 73 19 00 00 00 00 00 00 f0 3f");
}

TEST(Golden11, ReconstructionEvent) {
  expect_golden<ServerMessage>(
      R"(event { reconstruction { resolution: "m" sharpen: "s" max_error_um: 1 } sequence: 1 )"
      R"(monotonic_ns: 2 wall_ns: 3 })",
      "1a 17 30 01 38 04 40 06 4a 0f 0a 01 6d 12 01 73 19 00 00 00 00 00 00 f0 3f");
}

TEST(Golden11, StatusWithReconstruction) {
  expect_golden<ServerMessage>(
      R"(reply { id: 9 status { calibration { name: "n" sharpen_steps: 1 sharpen_steps: 2 } )"
      R"(reconstruction { resolution: "m" sharpen: "s" max_error_um: 1 } } })",
      "0a 1f 08 09 32 1b 3a 07 0a 01 6e 5a 02 01 02 b2 01 0f 0a 01 6d 12 01 73 19 00 00 00 "
      "00 00 00 f0 3f");
}

TEST(Golden11, DepthThatWasSharpened) {
  expect_golden<ServerMessage>(R"(frame { depth { sharpen_steps: 2 made_decimation: 4 } })",
                               "12 06 5a 04 70 02 78 04");
}

TEST(Golden11, Surface) {
  expect_golden<ServerMessage>(
      R"(frame { surface { shape: CYLINDER radius_mm: 1 axis_deg: 2 air_mm: 3 gel_mm: 4 )"
      R"(refraction: 5 } })",
      "12 32 a2 01 2f 08 02 11 00 00 00 00 00 00 f0 3f 19 00 00 00 00 00 00 00 40 21 00 00 "
      "00 00 00 00 08 40 29 00 00 00 00 00 00 10 40 31 00 00 00 00 00 00 14 40");
}

TEST(Golden11, Cloud) {
  expect_golden<ServerMessage>(
      R"(frame { cloud { encoding: CLOUD_INT16 width: 2 height: 1 metres_per_unit: 0.5 data: )"
      R"("d" decimation: 4 points: 5 make_ns: 6 } })",
      "12 1b aa 01 18 08 02 10 02 18 01 21 00 00 00 00 00 00 e0 3f 2a 01 64 30 04 38 05 40 "
      "06");
}

TEST(Golden11, Pose) {
  expect_golden<ServerMessage>(
      R"(frame { pose { tracking: RECOVERED since_sequence: 1 translation_mm { x: 1 y: 2 z: )"
      R"(3 } rotation_deg { z: 1 } unobservable { rotation { x: 1 } translation { y: 1 } } )"
      R"(centre_mm { y: 1 } residual_um: 3 points: 4 track_ns: 5 arm_mm: 2 } })",
      "12 68 b2 01 65 08 04 10 01 1a 1b 09 00 00 00 00 00 00 f0 3f 11 00 00 00 00 00 00 00 "
      "40 19 00 00 00 00 00 00 08 40 22 09 19 00 00 00 00 00 00 f0 3f 2a 16 0a 09 09 00 00 "
      "00 00 00 00 f0 3f 12 09 11 00 00 00 00 00 00 f0 3f 32 09 11 00 00 00 00 00 00 f0 3f "
      "39 00 00 00 00 00 00 08 40 40 04 48 05 51 00 00 00 00 00 00 00 40");
}

TEST(Golden11, ErrorCodes) {
  EXPECT_EQ(ERROR_UNSUPPORTED, 10);
  EXPECT_EQ(ERROR_DENIED, 11);
  EXPECT_EQ(ERROR_FLOOD, 12);
}

}  // namespace
}  // namespace dtact::v1
