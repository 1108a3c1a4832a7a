// Events beside the frames, and the calibration that a frame was measured by.
#include <gtest/gtest.h>

#include <variant>

#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

TEST(Stream, SendsEventsToEveryAuthenticatedClient) {
  Rig rig;
  RawClient subscribed(rig.tcp_port());
  RawClient idle(rig.tcp_port());
  subscribed.hello();
  idle.hello();
  subscribed.subscribe(v1::DEPTH_INT16);
  pipeline::ContactChanged made;
  made.in_contact = true;
  made.at = {11, 12, 13};
  made.contact.deepest_mm = 0.5;
  rig.port.emit(made);
  rig.port.emit(pipeline::ReferenceTaken{true, {.sequence = 13}});
  pipeline::StateChanged state{pipeline::State::serving, {}};
  state.health.set(pipeline::Health::reference_restored);
  rig.port.emit(state);
  for (auto* client : {&subscribed, &idle}) {
    auto event = client->event();
    EXPECT_TRUE(event.contact().contact().in_contact());
    EXPECT_EQ(event.contact().sequence(), 11U);
    EXPECT_EQ(event.contact().monotonic_ns(), 12);
    EXPECT_EQ(event.contact().contact().deepest_mm(), 0.5);
    EXPECT_EQ(event.sequence(), 11U);
    EXPECT_EQ(event.monotonic_ns(), 12);
    EXPECT_EQ(event.wall_ns(), 13);
    event = client->event();
    EXPECT_EQ(event.reference().sequence(), 13U);
    EXPECT_TRUE(event.reference().restored());
    event = client->event();
    EXPECT_EQ(event.state().state(), v1::STATE_SERVING);
    ASSERT_EQ(event.state().health_size(), 1);
    EXPECT_EQ(event.state().health(0), v1::HEALTH_REFERENCE_RESTORED);
  }
}

TEST(Stream, SendsNoEventsToWhoWantsNone) {
  Rig rig;
  RawClient quiet(rig.tcp_port());
  RawClient other(rig.tcp_port());
  quiet.hello();
  other.hello();
  auto message = subscribe();
  message.mutable_subscribe()->set_events(false);
  ASSERT_TRUE(quiet.request(message).has_done());
  rig.port.emit(pipeline::ReferenceTaken{true, {}});
  ASSERT_TRUE(other.event().has_reference());
  auto status = get_status();
  status.set_id(9);
  quiet.send(status);
  EXPECT_TRUE(quiet.receive().value_or(v1::ServerMessage{}).has_reply());
  message.mutable_subscribe()->set_events(true);
  ASSERT_TRUE(quiet.request(message).has_done());
  rig.port.emit(pipeline::ReferenceTaken{true, {}});
  EXPECT_TRUE(quiet.event().has_reference());
}

TEST(Stream, AFrameCarriesTheCalibrationThatItWasMeasuredBy) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  v1::ClientMessage activate;
  activate.mutable_activate_calibration()->set_number(0);
  activate.set_id(50);
  client.send(activate);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  const std::uint64_t key = std::get<pipeline::UseCalibration>(command->what).key;
  EXPECT_GT(key, 0U);
  auto frame = make_frame(1);
  frame.calibration = 0;  // the pipeline's key of the one at start
  rig.port.publish(frame);
  auto got = client.frame();
  EXPECT_EQ(got.calibration(), 1U) << "current in the store at start";
  pipeline::CommandDone done{*command, pipeline::Outcome::done, ""};
  done.at = {1, 2, 3};
  rig.port.emit(done);
  const auto event = client.event();
  EXPECT_EQ(event.calibration().name(), "factory");
  EXPECT_TRUE(event.calibration().has_number());
  EXPECT_EQ(event.calibration().number(), 0U);
  EXPECT_EQ(event.sequence(), 1U);
  EXPECT_EQ(event.monotonic_ns(), 2);
  EXPECT_EQ(event.wall_ns(), 3);
  frame.camera.sequence = 2;  // captured before, sent after
  rig.port.publish(frame);
  EXPECT_EQ(client.frame().calibration(), 1U);
  frame.calibration = key;
  rig.port.publish(frame);
  got = client.frame();
  EXPECT_TRUE(got.has_calibration());
  EXPECT_EQ(got.calibration(), 0U);
  frame.calibration.reset();
  rig.port.publish(frame);
  EXPECT_FALSE(client.frame().has_calibration());
}

TEST(Stream, AnUploadHasItsNumberOnceItIsStored) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  v1::ClientMessage upload;
  upload.mutable_upload_calibration()->set_name("ball");
  upload.mutable_upload_calibration()->set_calibration_toml("good");
  upload.mutable_upload_calibration()->set_reference_png("png");
  upload.set_id(50);
  client.send(upload);
  EXPECT_EQ(client.event().calibration().number(), 4U);
  auto frame = make_frame(1);
  frame.calibration = std::get<pipeline::UseCalibration>(rig.port.wait_command(0).value().what).key;
  rig.port.publish(frame);
  EXPECT_EQ(client.frame().calibration(), 4U);
  upload.mutable_upload_calibration()->set_calibration_toml("unwritable");
  client.send(upload);
  const auto event = client.event();
  EXPECT_EQ(event.calibration().name(), "ball");
  EXPECT_FALSE(event.calibration().has_number());
  frame.calibration = std::get<pipeline::UseCalibration>(rig.port.wait_command(1).value().what).key;
  rig.port.publish(frame);
  EXPECT_FALSE(client.frame().has_calibration());
}

}  // namespace
}  // namespace dtact::net::test
