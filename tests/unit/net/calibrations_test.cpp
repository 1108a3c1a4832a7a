// Requests about the daemon's calibrations.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using pipeline::CommandDone;
using pipeline::Outcome;
using testing::HasSubstr;

v1::ClientMessage upload(const std::string& name, const std::string& toml,
                         const std::string& png = "png") {
  v1::ClientMessage message;
  message.mutable_upload_calibration()->set_name(name);
  message.mutable_upload_calibration()->set_calibration_toml(toml);
  message.mutable_upload_calibration()->set_reference_png(png);
  return message;
}

v1::ClientMessage get_calibration() {
  v1::ClientMessage message;
  message.mutable_get_calibration();
  return message;
}

v1::ClientMessage get_calibration(std::uint64_t number) {
  auto message = get_calibration();
  message.mutable_get_calibration()->set_number(number);
  return message;
}

v1::ClientMessage list() {
  v1::ClientMessage message;
  message.mutable_list_calibrations();
  return message;
}

v1::ClientMessage activate(std::uint64_t number) {
  v1::ClientMessage message;
  message.mutable_activate_calibration()->set_number(number);
  return message;
}

/// Lets the pipeline report that it uses a calibration.
void be_calibrated(Rig& rig) {
  pipeline::Status status;
  status.calibration = std::make_shared<calibration::Calibration>();
  rig.port.set_status(status);
}

/// Number of the calibration marked current; 999 when none is.
std::uint64_t current_of(RawClient& client) {
  const auto reply = client.request(list());
  for (const auto& stored : reply.calibrations().calibrations()) {
    if (stored.current()) return stored.number();
  }
  return 999;
}

/// Number of the calibration marked in use; 999 when none is.
std::uint64_t in_use(RawClient& client) {
  const auto reply = client.request(list());
  for (const auto& stored : reply.calibrations().calibrations()) {
    if (stored.in_use()) return stored.number();
  }
  return 999;
}

void refuse_as_invalid(FakePort& port) { port.set_unfit("the camera gives 640x480"); }

TEST(Upload, IsCheckedUsedKeptAndReported) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  RawClient watcher(rig.tcp_port());
  client.hello();
  watcher.hello();
  const auto reply = client.request(upload("ball-4_mm", "good"));
  EXPECT_EQ(reply.done().calibration(), 4U);
  EXPECT_EQ(watcher.event().calibration().name(), "ball-4_mm");
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  EXPECT_EQ(std::get<pipeline::UseCalibration>(command->what).calibration->name, "ball-4_mm");

  be_calibrated(rig);
  const auto files = client.request(get_calibration()).calibration();
  EXPECT_EQ(files.name(), "ball-4_mm");
  EXPECT_EQ(files.calibration_toml(), "good");
  EXPECT_EQ(files.reference_png(), "png");
}

TEST(Upload, NamesWhatTheDaemonRemovedForIt) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(client.request(upload("ball", "good")).done().removed_size(), 0);
  const auto done = client.request(upload("pins", "good")).done();
  ASSERT_EQ(done.removed_size(), 1);
  EXPECT_EQ(done.removed(0).number(), 2U);
  EXPECT_EQ(done.removed(0).name(), "broken");
  EXPECT_TRUE(rig.wait_log("done, calibration 5, removed 2 broken"));
}

TEST(PinCalibration, IsListed) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage pin;
  pin.mutable_pin_calibration()->set_pinned(true);
  expect_invalid(client, pin, "pin_calibration.number is not set");
  pin.mutable_pin_calibration()->set_number(77);
  expect_invalid(client, pin, "there is no calibration 77");
  pin.mutable_pin_calibration()->set_number(3);
  EXPECT_TRUE(client.request(pin).has_done());
  const auto all = client.request(list()).calibrations();
  EXPECT_FALSE(all.calibrations(1).pinned());
  EXPECT_TRUE(all.calibrations(3).pinned());
}

TEST(PinCalibration, KeepsTheOrderOfCommandsThatWait) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  // All at once, so that the others wait while the first is on the worker.
  std::string bytes;
  for (std::uint64_t id = 1; id <= 3; ++id) {
    v1::ClientMessage message;
    if (id == 1) {
      message = list();
    } else {
      message.mutable_pin_calibration()->set_number(3);
      message.mutable_pin_calibration()->set_pinned(id == 2);
    }
    message.set_id(id);
    bytes += std::string(3, '\0') + static_cast<char>(message.ByteSizeLong());
    bytes += message.SerializeAsString();
  }
  client.send_bytes(bytes);
  for (int i = 0; i < 3; ++i) (void)client.reply();
  EXPECT_FALSE(client.request(list()).calibrations().calibrations(3).pinned());
}

TEST(Upload, NamesWhatIsWrong) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  expect_invalid(client, upload("../etc", "good"), "\"../etc\"; allowed are 1 to 64 letters");
  expect_invalid(client, upload("", "good"), "upload_calibration.name");
  expect_invalid(client, upload("..", "good"), "upload_calibration.name");
  expect_invalid(client, upload("a.b", "good"), "upload_calibration.name");
  expect_invalid(client, upload(std::string(65, 'x'), "good"), "upload_calibration.name");
  // The characters beside those that are allowed.
  for (const char c : std::string("@[`{/:,")) {
    expect_invalid(client, upload(std::string("a") + c, "good"), "upload_calibration.name");
  }
  // Byte 64 is within a character.
  std::string accents = "a";
  for (int i = 0; i < 40; ++i) accents += "\xc3\xa9";
  expect_invalid(client, upload(accents, "good"), "\xc3\xa9\"; allowed are 1 to 64 letters");
  expect_invalid(client, upload("x", ""), "calibration_toml or reference_png is empty");
  expect_invalid(client, upload("x", "bad"), "calibration.toml:3: scale missing");
  EXPECT_TRUE(client.request(upload("x", "good")).has_done());  // none of them is in the way
}

TEST(Upload, TakesEveryNameThatIsAllowed) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  for (const std::string& name : {std::string("azAZ09-_"), std::string("0"), std::string("-"),
                                  "m" + std::string(62, '5') + "M"}) {
    EXPECT_TRUE(client.request(upload(name, "good")).has_done()) << name;
    be_calibrated(rig);
    EXPECT_EQ(client.request(get_calibration()).calibration().name(), name);
  }
}

TEST(Upload, IsNotKeptWhenThePipelineRefusesIt) {
  Rig rig({}, refuse_as_invalid);
  RawClient client(rig.tcp_port());
  client.hello();
  expect_invalid(client, upload("x", "good"), "640x480");
  be_calibrated(rig);
  EXPECT_EQ(client.request(get_calibration()).calibration().name(), "first");
  expect_invalid(client, upload("x", "good"), "640x480");  // and not busy
}

TEST(Upload, SaysWhenItCouldNotBeStored) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  const auto reply = client.request(upload("x", "unwritable"));
  EXPECT_EQ(reply.error().code(), v1::ERROR_STORAGE);
  EXPECT_THAT(reply.error().message(), HasSubstr("disk full"));
}

TEST(Upload, ThatCouldNotBeStoredIsInUseUnderNoNumber) {
  Rig rig({}, answer_done);
  be_calibrated(rig);
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(client.request(upload("x", "unwritable")).error().code(), v1::ERROR_STORAGE);
  EXPECT_EQ(in_use(client), 999U);
  EXPECT_EQ(current_of(client), 1U);
  // Before: the current one's files, of which no depth is made.
  const auto reply = client.request(get_calibration());
  EXPECT_EQ(reply.error().code(), v1::ERROR_STORAGE);
  EXPECT_THAT(reply.error().message(), HasSubstr("could not be written"));
  EXPECT_TRUE(client.request(upload("x", "good")).has_done());
  EXPECT_EQ(in_use(client), 4U);
  EXPECT_EQ(current_of(client), 4U);
}

TEST(GetCalibration, NeedsOne) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  const auto reply = client.request(get_calibration());
  EXPECT_EQ(reply.error().code(), v1::ERROR_UNCALIBRATED);
  EXPECT_THAT(reply.error().message(), HasSubstr("dtactctl calibration upload"));
}

TEST(GetCalibration, TakesANumber) {
  Rig rig;  // works on a daemon that uses none
  RawClient client(rig.tcp_port());
  client.hello();
  auto files = client.request(get_calibration(0)).calibration();
  EXPECT_EQ(files.name(), "factory");
  EXPECT_TRUE(files.has_number());
  EXPECT_EQ(files.number(), 0U);
  files = client.request(get_calibration(2)).calibration();
  EXPECT_EQ(files.calibration_toml(), "bad");  // damaged or not
  EXPECT_EQ(files.number(), 2U);
  expect_invalid(client, get_calibration(7), "there is no calibration 7");
  be_calibrated(rig);
  EXPECT_EQ(client.request(get_calibration()).calibration().number(), 1U);
}

// At most 8 may wait; answered ones don't count.
TEST(GetCalibration, OneAfterAnotherAreNeverTooMany) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  for (int i = 0; i < 17; ++i) {
    ASSERT_EQ(client.request(get_calibration(1)).calibration().name(), "first") << i;
    ASSERT_EQ(client.request(list()).calibrations().calibrations_size(), 4) << i;
  }
}

TEST(ListCalibrations, ReportsEverything) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  const auto all = client.request(list()).calibrations();
  ASSERT_EQ(all.calibrations_size(), 4);
  EXPECT_EQ(all.calibrations(0).number(), 0U);
  EXPECT_EQ(all.calibrations(0).uploaded(), "");
  EXPECT_FALSE(all.calibrations(0).current());
  const auto& first = all.calibrations(1);
  EXPECT_EQ(first.number(), 1U);
  EXPECT_EQ(first.name(), "first");
  EXPECT_EQ(first.uploaded(), "2026-01-31T12:00:00Z");
  EXPECT_TRUE(first.current());
  EXPECT_EQ(first.summary().method(), "lut");
  EXPECT_EQ(first.summary().mm_per_px(), 0.0414);
  EXPECT_EQ(first.summary().width(), 580U);
  EXPECT_EQ(first.summary().frame_height(), 600U);
  EXPECT_EQ(first.summary().covered_to_mm(), 1.4);
  EXPECT_FALSE(all.calibrations(2).has_summary());
  EXPECT_EQ(all.calibrations(2).damage(), "calibration.toml:3: scale missing");
  EXPECT_TRUE(client.request(upload("ball", "good")).has_done());
  EXPECT_EQ(current_of(client), 4U);
}

TEST(ListCalibrations, AnswersWithAnEmptyListWhereThereIsNone) {
  Rig rig({}, answer_done);
  rig.store.clear();
  RawClient client(rig.tcp_port());
  client.hello();
  const auto reply = client.request(list());
  ASSERT_TRUE(reply.has_calibrations());
  EXPECT_EQ(reply.calibrations().calibrations_size(), 0);
}

TEST(ListCalibrations, ReportsTheOneInUse) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(in_use(client), 999U);  // the pipeline could not use the current one
  be_calibrated(rig);
  EXPECT_EQ(in_use(client), 1U);
}

TEST(ActivateCalibration, IsCheckedUsedKeptAndReported) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  RawClient watcher(rig.tcp_port());
  client.hello();
  watcher.hello();
  const auto reply = client.request(activate(0));
  EXPECT_TRUE(reply.has_done());
  EXPECT_FALSE(reply.done().has_calibration());
  EXPECT_EQ(watcher.event().calibration().name(), "factory");
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  EXPECT_EQ(std::get<pipeline::UseCalibration>(command->what).calibration->name, "factory");
  EXPECT_EQ(current_of(client), 0U);
  EXPECT_TRUE(client.request(activate(1)).has_done());
  EXPECT_EQ(watcher.event().calibration().name(), "first");
  EXPECT_EQ(current_of(client), 1U);
}

TEST(ActivateCalibration, ChangesNothingWhenItCannotBeUsed) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  expect_invalid(client, activate(2), "calibration.toml:3: scale missing");
  expect_invalid(client, activate(7), "there is no calibration 7");
  auto without = activate(0);
  without.mutable_activate_calibration()->clear_number();
  expect_invalid(client, without, "activate_calibration.number is not set");
  EXPECT_EQ(current_of(client), 1U);
  EXPECT_TRUE(client.request(activate(0)).has_done());  // none of them is in the way
}

TEST(ActivateCalibration, IsNotKeptWhenThePipelineRefusesIt) {
  Rig rig({}, refuse_as_invalid);
  RawClient client(rig.tcp_port());
  client.hello();
  expect_invalid(client, activate(0), "640x480");
  EXPECT_EQ(current_of(client), 1U);
  expect_invalid(client, activate(0), "640x480");  // and not busy
}

TEST(ActivateCalibration, SaysWhenItCouldNotBeStored) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  be_calibrated(rig);
  const auto reply = client.request(activate(3));
  EXPECT_EQ(reply.error().code(), v1::ERROR_STORAGE);
  EXPECT_THAT(reply.error().message(), HasSubstr("disk full"));
  EXPECT_EQ(in_use(client), 3U);
  EXPECT_EQ(current_of(client), 1U);
  EXPECT_TRUE(client.request(activate(0)).has_done());
  EXPECT_EQ(in_use(client), 0U);
  EXPECT_EQ(current_of(client), 0U);
}

TEST(ActivateCalibration, WaitsForAnotherChange) {
  Rig rig;  // a pipeline that does not answer
  RawClient client(rig.tcp_port());
  client.hello();
  auto message = upload("ball", "good");
  message.set_id(50);
  client.send(message);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  EXPECT_EQ(client.request(activate(0)).error().code(), v1::ERROR_BUSY);
  EXPECT_EQ(client.request(upload("other", "good")).error().code(), v1::ERROR_BUSY);
  rig.port.emit(CommandDone{*command, Outcome::done, ""});
  EXPECT_EQ(client.reply().id(), 50U);
}

// Preparing takes up to a second; on the network thread it would stop all streams.
TEST(ActivateCalibration, OthersAreServedWhileItIsPrepared) {
  Rig rig({}, answer_done);
  rig.port.set_slow(true);
  RawClient client(rig.tcp_port());
  client.hello();
  auto message = activate(0);
  message.set_id(50);
  client.send(message);
  RawClient other(rig.tcp_port());
  other.hello();
  v1::ClientMessage ping;
  ping.mutable_ping();
  EXPECT_TRUE(other.request(ping).has_pong());
  v1::ClientMessage quarter;
  quarter.mutable_set_reconstruction()->set_resolution("quarter");
  EXPECT_EQ(other.request(quarter).error().code(), v1::ERROR_BUSY);
  rig.port.set_slow(false);
  EXPECT_EQ(client.reply().id(), 50U);
  EXPECT_EQ(other.event().calibration().name(), "factory");
}

TEST(ActivateCalibration, IsRefusedAsBusyWhenThePipelineIsFull) {
  Rig rig;
  rig.port.set_full(true);
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(client.request(upload("x", "good")).error().code(), v1::ERROR_BUSY);
  EXPECT_EQ(client.request(activate(0)).error().code(), v1::ERROR_BUSY);
}

}  // namespace
}  // namespace dtact::net::test
