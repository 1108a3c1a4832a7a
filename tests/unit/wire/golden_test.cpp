// Messages byte for byte, written by hand from the protobuf encoding specification. A renumbered
// field, a changed type or a moved enum value fails here: clients that are already installed would
// read it wrongly.
#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "proto/dtact.pb.h"

namespace dtact::v1 {
namespace {

std::string bytes(std::string_view hex) {
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  std::string out;
  for (std::size_t i = 0; i < hex.size(); ++i) {
    if (hex[i] == ' ') continue;
    out.push_back(static_cast<char>(digit(hex[i]) * 16 + digit(hex[i + 1])));
    ++i;
  }
  return out;
}

TEST(Golden, Hello) {
  ClientMessage m;
  m.set_id(1);
  m.mutable_hello()->set_major(1);
  m.mutable_hello()->set_minor(0);
  m.mutable_hello()->set_program("x");
  EXPECT_EQ(m.SerializeAsString(), bytes("08 01 12 05 08 01 1a 01 78"));
}

TEST(Golden, Subscribe) {
  ClientMessage m;
  m.set_id(2);
  m.mutable_subscribe()->set_depth(DEPTH_DELTA_ZSTD);
  m.mutable_subscribe()->set_luma(LUMA_GREY8);
  m.mutable_subscribe()->set_every(3);
  m.mutable_subscribe()->set_summary(true);
  EXPECT_EQ(m.SerializeAsString(), bytes("08 02 1a 08 08 02 10 01 18 03 20 01"));
}

TEST(Golden, SetLight) {
  ClientMessage m;
  m.set_id(3);
  m.mutable_set_light()->set_brightness(0);  // set to 0 is not the same as unset
  m.mutable_set_light()->set_scheme("all");
  m.mutable_set_light()->add_leds()->set_r(255);
  EXPECT_EQ(m.SerializeAsString(), bytes("08 03 22 0c 08 00 12 03 61 6c 6c 1a 03 08 ff 01"));
}

TEST(Golden, OtherRequests) {
  ClientMessage m;
  m.set_id(4);
  m.mutable_rezero()->set_force(true);
  EXPECT_EQ(m.SerializeAsString(), bytes("08 04 2a 02 08 01"));
  m.mutable_get_status();
  EXPECT_EQ(m.SerializeAsString(), bytes("08 04 32 00"));
  m.mutable_get_calibration();
  EXPECT_EQ(m.SerializeAsString(), bytes("08 04 3a 00"));
  m.mutable_get_calibration()->set_number(0);  // the configured one is not the current one
  EXPECT_EQ(m.SerializeAsString(), bytes("08 04 3a 02 08 00"));
  m.mutable_list_calibrations();
  EXPECT_EQ(m.SerializeAsString(), bytes("08 04 4a 00"));
  m.mutable_activate_calibration()->set_number(3);
  EXPECT_EQ(m.SerializeAsString(), bytes("08 04 52 02 08 03"));
  m.mutable_upload_calibration()->set_name("n");
  m.mutable_upload_calibration()->set_calibration_toml("t");
  m.mutable_upload_calibration()->set_reference_png("p");
  EXPECT_EQ(m.SerializeAsString(), bytes("08 04 42 09 0a 01 6e 12 01 74 1a 01 70"));
}

TEST(Golden, Replies) {
  ServerMessage m;
  m.mutable_reply()->set_id(9);
  m.mutable_reply()->mutable_error()->set_code(ERROR_CONTACT);
  m.mutable_reply()->mutable_error()->set_message("m");
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 09 08 09 12 05 08 05 12 01 6d"));
  m.mutable_reply()->mutable_done();
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 04 08 09 22 00"));
  m.mutable_reply()->mutable_done()->set_calibration(3);
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 06 08 09 22 02 08 03"));
  m.mutable_reply()->mutable_light()->set_brightness(7);
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 06 08 09 2a 02 08 07"));
  m.mutable_reply()->mutable_status()->set_state(STATE_SERVING);
  m.mutable_reply()->mutable_status()->add_health(HEALTH_UNCALIBRATED);
  m.mutable_reply()->mutable_status()->set_advice("a");
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 0c 08 09 32 08 08 03 12 01 01 1a 01 61"));
  m.mutable_reply()->mutable_calibration()->set_name("n");
  m.mutable_reply()->mutable_calibration()->set_calibration_toml("t");
  m.mutable_reply()->mutable_calibration()->set_reference_png("p");
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 0d 08 09 3a 09 0a 01 6e 12 01 74 1a 01 70"));
}

TEST(Golden, Calibrations) {
  ServerMessage m;
  m.mutable_reply()->set_id(9);
  m.mutable_reply()->mutable_calibration()->set_name("n");
  m.mutable_reply()->mutable_calibration()->set_number(0);
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 09 08 09 3a 05 0a 01 6e 20 00"));
  auto& list = *m.mutable_reply()->mutable_calibrations();
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 04 08 09 42 00"));
  auto& stored = *list.add_calibrations();
  stored.set_number(3);
  stored.set_name("n");
  stored.set_uploaded("t");
  stored.set_current(true);
  stored.set_damage("d");
  EXPECT_EQ(m.SerializeAsString(),
            bytes("0a 13 08 09 42 0f 0a 0d 08 03 12 01 6e 1a 01 74 20 01 32 01 64"));
  stored.set_in_use(false);  // set to false is not the same as unset
  EXPECT_EQ(m.SerializeAsString(),
            bytes("0a 15 08 09 42 11 0a 0f 08 03 12 01 6e 1a 01 74 20 01 32 01 64 38 00"));
  stored.clear_in_use();
  auto& summary = *stored.mutable_summary();  // in the place of the damage
  summary.set_name("n");
  summary.set_method("l");
  summary.set_mm_per_px(0.5);
  summary.set_width(1);
  summary.set_height(2);
  summary.set_covered_from_mm(1);
  summary.set_covered_to_mm(2);
  summary.set_created("c");
  summary.set_frame_width(3);
  summary.set_frame_height(4);
  EXPECT_EQ(m.SerializeAsString(),
            bytes("0a 3e 08 09 42 3a 0a 38 08 03 12 01 6e 1a 01 74 20 01 2a 2c"  // … summary
                  "0a 01 6e 12 01 6c 19 00 00 00 00 00 00 e0 3f 20 01 28 02"
                  "31 00 00 00 00 00 00 f0 3f 39 00 00 00 00 00 00 00 40 42 01 63 48 03 50 04"));
}

TEST(Golden, HelloReply) {
  ServerMessage m;
  m.mutable_reply()->set_id(1);
  auto& hello = *m.mutable_reply()->mutable_hello();
  hello.set_major(1);
  hello.set_program("d");
  auto& surface = *hello.mutable_surface_frame();
  surface.set_frame_id("f");
  surface.set_right_handed(true);
  surface.set_mirrored_from_outside(true);
  surface.set_origin("o");
  surface.set_axes("a");
  EXPECT_EQ(m.SerializeAsString(), bytes("0a 18 08 01 1a 14 08 01 1a 01 64 22 0d"
                                         "0a 01 66 10 01 18 01 22 01 6f 2a 01 61"));
}

TEST(Golden, Events) {
  ServerMessage m;
  auto& contact = *m.mutable_event()->mutable_contact();
  contact.set_sequence(7);
  contact.set_monotonic_ns(8);  // sint64: zigzag 16
  contact.mutable_contact()->set_touching(true);
  EXPECT_EQ(m.SerializeAsString(), bytes("1a 0a 0a 08 08 07 10 10 1a 02 08 01"));
  m.mutable_event()->mutable_light()->set_brightness(7);
  EXPECT_EQ(m.SerializeAsString(), bytes("1a 04 12 02 08 07"));
  m.mutable_event()->mutable_reference()->set_sequence(5);
  m.mutable_event()->mutable_reference()->set_restored(true);
  EXPECT_EQ(m.SerializeAsString(), bytes("1a 06 1a 04 08 05 10 01"));
  m.mutable_event()->mutable_state()->set_state(STATE_CAMERA_LOST);
  m.mutable_event()->mutable_state()->add_health(HEALTH_CAMERA_TROUBLE);
  EXPECT_EQ(m.SerializeAsString(), bytes("1a 07 22 05 08 05 12 01 0a"));
  m.mutable_event()->mutable_calibration()->set_name("n");
  EXPECT_EQ(m.SerializeAsString(), bytes("1a 05 2a 03 0a 01 6e"));
}

// One frame with every field.
const char* const kFrame =
    "12 a8 01"                                // ServerMessage.frame, 168 bytes
    "08 01 10 04 18 06 20 02 28 08 30 0a"     // sequence … published_ns
    "3a 02 03 0c"                             // health, packed
    "42 0b 08 80 01 12 06 08 01 10 02 18 03"  // light
    "4a 41 08 01"                             // contact: touching, then seven doubles
    "11 00 00 00 00 00 00 f0 3f 19 00 00 00 00 00 00 00 40 21 00 00 00 00 00 00 08 40"
    "29 00 00 00 00 00 00 10 40 31 00 00 00 00 00 00 14 40 39 00 00 00 00 00 00 18 40"
    "41 00 00 00 00 00 00 1c 40"
    "52 10 08 01 10 02 18 03 20 04 28 05 30 06 38 07 40 08"  // times
    "5a 22 08 01 10 02 18 01 21 00 00 00 00 00 00 e0 3f 29 00 00 00 00 00 00 f0 3f"
    "30 ff ff 03 3a 04 01 00 ff ff"        // depth; −32768 as zigzag 65535
    "62 0a 08 01 10 02 18 01 22 02 0a 0b"  // luma
    "68 ac 02"                             // dropped 300
    "72 01 66";                            // frame_id

ServerMessage full_frame() {
  ServerMessage m;
  auto& f = *m.mutable_frame();
  f.set_sequence(1);
  f.set_monotonic_ns(2);
  f.set_wall_ns(3);
  f.set_meaning(TIMESTAMP_END_OF_FRAME);
  f.set_ready_ns(4);
  f.set_published_ns(5);
  f.add_health(HEALTH_LIGHT_UNSETTLED);
  f.add_health(HEALTH_NOT_REALTIME);
  f.mutable_light()->set_brightness(128);
  auto& led = *f.mutable_light()->add_leds();
  led.set_r(1);
  led.set_g(2);
  led.set_b(3);
  auto& contact = *f.mutable_contact();
  contact.set_touching(true);
  contact.set_area_mm2(1);
  contact.set_x_mm(2);
  contact.set_y_mm(3);
  contact.set_deepest_mm(4);
  contact.set_deepest_x_mm(5);
  contact.set_deepest_y_mm(6);
  contact.set_volume_mm3(7);
  auto& times = *f.mutable_times();
  times.set_decode_ns(1);
  times.set_rectify_ns(2);
  times.set_smooth_ns(3);
  times.set_list_ns(4);
  times.set_inspect_ns(5);
  times.set_encode_ns(6);
  times.set_activity_ns(7);
  times.set_publish_ns(8);
  auto& depth = *f.mutable_depth();
  depth.set_encoding(DEPTH_INT16);
  depth.set_width(2);
  depth.set_height(1);
  depth.set_mm_per_px(0.5);
  depth.set_um_per_unit(1);
  depth.set_untrusted_value(-32768);
  depth.set_data(bytes("01 00 ff ff"));
  auto& luma = *f.mutable_luma();
  luma.set_encoding(LUMA_GREY8);
  luma.set_width(2);
  luma.set_height(1);
  luma.set_data(bytes("0a 0b"));
  f.set_dropped(300);
  f.set_frame_id("f");
  return m;
}

TEST(Golden, Frame) { EXPECT_EQ(full_frame().SerializeAsString(), bytes(kFrame)); }

TEST(Golden, FrameIsReadBack) {
  ServerMessage m;
  ASSERT_TRUE(m.ParseFromString(bytes(kFrame)));
  EXPECT_EQ(m.frame().sequence(), 1U);
  EXPECT_EQ(m.frame().depth().untrusted_value(), -32768);
  EXPECT_EQ(m.frame().contact().volume_mm3(), 7.0);
  EXPECT_EQ(m.frame().dropped(), 300U);
  EXPECT_EQ(m.frame().health(1), HEALTH_NOT_REALTIME);
}

TEST(Golden, ErrorCodes) {
  EXPECT_EQ(ERROR_BAD_MESSAGE, 1);
  EXPECT_EQ(ERROR_TOO_LARGE, 2);
  EXPECT_EQ(ERROR_VERSION, 3);
  EXPECT_EQ(ERROR_INVALID, 4);
  EXPECT_EQ(ERROR_CONTACT, 5);
  EXPECT_EQ(ERROR_DEVICE, 6);
  EXPECT_EQ(ERROR_BUSY, 7);
  EXPECT_EQ(ERROR_UNCALIBRATED, 8);
  EXPECT_EQ(ERROR_STORAGE, 9);
}

}  // namespace
}  // namespace dtact::v1
