// dtactctl led --measure against a daemon that a test plays, frame by frame.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/unit/client/played_daemon.hpp"
#include "tests/unit/ctl/run_ctl.hpp"

namespace dtact::ctl {
namespace {

using client::test::Peer;
using client::test::PlayedDaemon;
using test::ctl;
using testing::ElementsAreArray;
using testing::HasSubstr;

constexpr std::uint32_t kBefore = 50;   // too dim to step down from
constexpr std::uint32_t kBright = 255;  // so the measurement takes this
constexpr std::uint32_t kDark = 127;    // and half of it

/// The mean grey of 200 under the bright light and 90 under the dark one.
void fill(v1::LumaMap& map, std::uint32_t brightness) {
  map.set_encoding(v1::LUMA_GREY8);
  map.set_width(3);
  map.set_height(2);
  const int grey = brightness == kBright ? 200 : 90;
  for (const int off : {-20, -10, 0, 5, 10, 15})
    *map.mutable_data() += static_cast<char>(grey + off);
}

/// A ring and a camera whose picture follows the ring late.
class LateCamera {
 public:
  /// Frames that each step takes until the picture is complete.
  std::vector<std::uint32_t> darker = std::vector<std::uint32_t>(10, 1);
  std::vector<std::uint32_t> brighter = std::vector<std::uint32_t>(10, 2);
  /// Frames under the first light, which has to come to rest, that show contact.
  std::size_t in_contact = 0;
  /// The brightness of each request.
  std::vector<std::uint32_t> set;

  void play(Peer& peer) {
    peer.greet();
    light_.set_brightness(kBefore);
    for (std::uint32_t i = 0; i < 8; ++i) light_.add_leds()->set_r(30 * i);
    for (;;) {
      const v1::ClientMessage request = peer.request();
      v1::ServerMessage answer;
      v1::Reply& reply = *answer.mutable_reply();
      reply.set_id(request.id());
      if (request.has_get_status()) {
        *reply.mutable_status()->mutable_light() = light_;
        reply.mutable_status()->mutable_camera()->set_fps(1000);
      } else if (request.has_subscribe()) {
        subscribed = request.subscribe();
        reply.mutable_done();
      } else {
        before_ = light_;
        light_.set_brightness(request.set_light().brightness());
        *light_.mutable_leds() = request.set_light().leds();
        *reply.mutable_light() = light_;
        set.push_back(light_.brightness());
      }
      sent_ = client::test::framed(answer);
      if (request.has_set_light()) show();
      peer.send_bytes(sent_);
    }
  }

  v1::Subscribe subscribed;

 private:
  /// As many frames as are looked at. 16 pass before the first light counts as at rest, then 8 have
  /// to be alike.
  void show() {
    const std::size_t steps = set.size() - 1;
    if (steps == 0) {
      for (int i = 0; i < 3; ++i) frame(before_, kBefore, false);
      for (std::size_t i = 0; i < 24; ++i) frame(light_, kBright, i < in_contact);
    } else if (steps <= 20) {
      const std::uint32_t late = (steps % 2 == 1 ? darker : brighter).at((steps - 1) / 2);
      frame(before_, before_.brightness(), false);
      for (std::uint32_t i = 0; i < late; ++i) frame(light_, before_.brightness(), false);
      for (int i = 0; i < 8; ++i) frame(light_, light_.brightness(), false);
    }
  }

  void frame(const v1::LightState& light, std::uint32_t seen, bool contact) {
    v1::ServerMessage message;
    v1::Frame& made = *message.mutable_frame();
    made.set_sequence(++sequence_);
    *made.mutable_light() = light;
    made.mutable_light()->set_since_ns(static_cast<std::int64_t>(sequence_));
    made.mutable_contact()->set_in_contact(contact);
    fill(*made.mutable_luma(), seen);
    sent_ += client::test::framed(message);
  }

  std::string sent_;
  v1::LightState light_;
  v1::LightState before_;
  std::uint64_t sequence_ = 40;
};

test::Result measure(LateCamera& camera, std::vector<std::string> options = {}) {
  PlayedDaemon daemon({[&](Peer& peer) { camera.play(peer); }});
  std::vector<std::string> arguments{"--port", std::to_string(daemon.options.port), "led",
                                     "--measure"};
  arguments.insert(arguments.end(), options.begin(), options.end());
  test::Result result = ctl(arguments);
  daemon.finish();
  return result;
}

TEST(LightDelay, IsTheWorstOfAllSteps) {
  LateCamera camera;
  camera.darker[3] = 4;
  camera.brighter[7] = 6;
  const auto result = measure(camera, {"--json"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out,
            "{\"darker\":[1,1,1,4,1,1,1,1,1,1],\"brighter\":[2,2,2,2,2,2,2,6,2,2],"
            "\"light_delay_frames\":6}\n");
  EXPECT_EQ(camera.subscribed.ShortDebugString(), "luma: LUMA_GREY8");
  std::vector<std::uint32_t> lights{kBright};
  for (int i = 0; i < 10; ++i) lights.insert(lights.end(), {kDark, kBright});
  lights.push_back(kBefore);
  EXPECT_THAT(camera.set, ElementsAreArray(lights));
}

TEST(LightDelay, IsPrintedForTheConfiguration) {
  LateCamera camera;
  camera.darker = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12};
  const auto result = measure(camera);
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out,
            "darker    median 5, worst 12 frames of 10 steps\n"
            "brighter  median 2, worst 2 frames of 10 steps\n"
            "For the configuration:\n[camera]\nlight_delay_frames = 12\n");
}

// The first frames under a light may still show the one before, and with it a contact that has
// ended.
TEST(LightDelay, LooksForContactOnceThePictureMayRest) {
  LateCamera ended;
  ended.in_contact = 16;
  EXPECT_EQ(measure(ended).code, 0);
  LateCamera there;
  there.in_contact = 17;
  const auto result = measure(there);
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.error, HasSubstr("there is contact: lift the object"));
  EXPECT_THAT(there.set, testing::ElementsAre(kBright, kBefore)) << "the light is as before";
}

}  // namespace
}  // namespace dtact::ctl
