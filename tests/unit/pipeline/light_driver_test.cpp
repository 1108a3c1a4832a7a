#include "daemon/pipeline/light_driver.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "tests/fakes/fake_ring.hpp"

// A missing value ends the test by the exception of its access.
// NOLINTBEGIN(bugprone-unchecked-optional-access)
namespace dtact::pipeline {
namespace {

hal::Light dimmed(int brightness) {
  hal::Light light;
  light.brightness = static_cast<std::uint8_t>(brightness);
  return light;
}

class LightDriverTest : public ::testing::Test {
 protected:
  void take_notes() {
    LightNote note;
    while (driver.next_note(note)) notes.push_back(note);
  }
  /// Waits for the next event.
  std::optional<Event> next() {
    Event event;
    for (int i = 0; i < 5000; ++i) {
      take_notes();
      if (driver.next_event(event)) return event;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return std::nullopt;
  }
  template <typename Condition>
  bool eventually(Condition condition) {
    for (int i = 0; i < 1000 && !condition(); ++i) {
      take_notes();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return condition();
  }
  std::vector<LightNote> notes;
  Exchange exchange{DepthFrame{}};
  fakes::FakeRing::Handle ring;
  LightDriver driver{std::make_unique<fakes::FakeRing>(ring), dimmed(200), base::system_clock(),
                     exchange};
};

TEST_F(LightDriverTest, ShowsTheFirstLightBeforeItReturns) {
  driver.start();
  ASSERT_EQ(ring.all().size(), 1U);
  EXPECT_EQ(ring.all()[0].brightness, 200);
  LightNote note;
  ASSERT_TRUE(driver.next_note(note));
  EXPECT_TRUE(note.begins);
  ASSERT_TRUE(driver.next_note(note));
  EXPECT_FALSE(note.begins);
  EXPECT_EQ(note.light.brightness, 200);
}

TEST_F(LightDriverTest, AnswersAndReportsEveryone) {
  driver.start();
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  const auto done = next();
  ASSERT_TRUE(done);
  EXPECT_EQ(std::get<SetLight>(std::get<CommandDone>(*done).command.what).light.brightness, 100);
  EXPECT_EQ(std::get<CommandDone>(*done).outcome, Outcome::done);
  const auto changed = next();
  ASSERT_TRUE(changed);
  EXPECT_EQ(std::get<LightChanged>(*changed).light.brightness, 100);
  EXPECT_EQ(driver.light().brightness, 100);
  pollfd poll{.fd = exchange.wake.get(), .events = POLLIN, .revents = 0};
  EXPECT_EQ(::poll(&poll, 1, 5000), 1);
}

TEST_F(LightDriverTest, TheLastWriterWins) {
  driver.start();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(driver.submit({SetLight{dimmed(i)}}));
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(next());
  EXPECT_EQ(driver.light().brightness, 9);
  EXPECT_EQ(ring.all().back().brightness, 9);
}

// Before: a client that repeated the brightness ten times a second left no frame with depth at 20
// frames a second.
TEST_F(LightDriverTest, TheSameLightAgainIsWrittenAndChangesNoPicture) {
  exchange.light_lag_ns = 1000;
  driver.start();
  const auto since_ns = driver.light_since_ns();
  ASSERT_TRUE(driver.submit({SetLight{dimmed(200)}}));
  const auto done = std::get<CommandDone>(next().value());
  EXPECT_EQ(done.outcome, Outcome::done);
  EXPECT_EQ(done.light_since_ns, since_ns);
  EXPECT_EQ(ring.all().size(), 2U);
  take_notes();
  EXPECT_EQ(notes.size(), 2U) << "of the start";
  ring.broken = true;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(200)}}));
  EXPECT_EQ(std::get<CommandDone>(next().value()).outcome, Outcome::device_error);
  take_notes();
  ASSERT_EQ(notes.size(), 4U) << "half a write may have changed the LEDs";
  EXPECT_TRUE(notes[2].begins);
  EXPECT_TRUE(notes[3].failed);
}

TEST_F(LightDriverTest, AFailureIsAnswerConditionAndSentence) {
  driver.start();
  ring.broken = true;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  const auto done = next();
  ASSERT_TRUE(done);
  EXPECT_EQ(std::get<CommandDone>(*done).outcome, Outcome::device_error);
  EXPECT_EQ(std::get<CommandDone>(*done).message, "the fake ring is broken: fix it");
  EXPECT_TRUE(driver.trouble());
  EXPECT_EQ(driver.message(), "the fake ring is broken: fix it");
  EXPECT_EQ(driver.light().brightness, 200);  // the light that it still shows
  ring.broken = false;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  EXPECT_EQ(std::get<CommandDone>(next().value()).outcome, Outcome::done);
  EXPECT_FALSE(driver.trouble());
  EXPECT_EQ(driver.message(), "");
  driver.stop();
  take_notes();
  // At the start, then the light that failed, the one still shown, and the first again.
  std::vector<std::pair<bool, int>> reported;
  for (const LightNote& note : notes) reported.emplace_back(note.begins, note.light.brightness);
  EXPECT_EQ(reported,
            (std::vector<std::pair<bool, int>>{
                {true, 200}, {false, 200}, {true, 100}, {false, 200}, {true, 100}, {false, 100}}));
}

TEST_F(LightDriverTest, AfterAFailedCommandTheLightBeforeItIsReSent) {
  hal::RingReport often;
  often.due = std::chrono::milliseconds(1);
  ring.set_report(often);
  driver.start();
  ring.broken = true;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  ASSERT_TRUE(next());
  {
    const std::scoped_lock lock(ring.mutex);
    ring.attended.reset();
  }
  ASSERT_TRUE(eventually([&] {
    const std::scoped_lock lock(ring.mutex);
    return ring.attended.has_value();
  }));
  EXPECT_EQ(ring.attended->brightness, 200);
}

TEST_F(LightDriverTest, AReSendThatFailsIsAConditionUntilItHeals) {
  driver.start();
  ring.set_report({.ok = false, .message = "the wire is cut", .note = {}, .writes = 2});
  EXPECT_TRUE(eventually([&] { return driver.trouble(); }));
  EXPECT_TRUE(eventually([&] { return driver.message() == "the wire is cut"; }));
  ring.set_report({.ok = true, .message = {}, .note = {}, .writes = 3});
  EXPECT_TRUE(eventually([&] { return !driver.trouble() && driver.message().empty(); }));
}

// The LEDs may show what failed until the light before it is sent again.
TEST_F(LightDriverTest, AfterAFailedCommandAReSendThatWorksIsAReturn) {
  exchange.light_lag_ns = 1000;
  driver.start();
  ring.broken = true;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  ASSERT_TRUE(next());
  EXPECT_EQ(driver.light_since_ns(), std::nullopt);
  ring.set_report({.ok = true, .message = {}, .note = {}, .writes = 3});
  EXPECT_TRUE(eventually([&] { return driver.light_since_ns().has_value(); }));
  EXPECT_FALSE(driver.trouble());
  driver.stop();
  take_notes();
  ASSERT_EQ(notes.size(), 6U);
  EXPECT_TRUE(notes[3].failed);
  EXPECT_TRUE(notes[4].begins);
  EXPECT_TRUE(notes[5].returned);
  EXPECT_FALSE(notes[5].failed);
  EXPECT_EQ(notes[5].light.brightness, 200);
  EXPECT_EQ(driver.light_since_ns(), notes[5].at_ns + 1000);
}

TEST_F(LightDriverTest, WhatIsWorthKnowingOfTheRingIsReportedWhileNothingIsWrong) {
  driver.start();
  ring.set_report({.ok = true, .message = {}, .note = "one write was late", .writes = 2});
  EXPECT_TRUE(eventually([&] { return driver.message() == "one write was late"; }));
  EXPECT_FALSE(driver.trouble());
  ring.broken = true;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  ASSERT_TRUE(next());
  EXPECT_EQ(driver.message(), "the fake ring is broken: fix it");
}

// Only the next write shows whether the ring works, so its report says nothing of it.
TEST_F(LightDriverTest, ARingThatNeverReSendsHealsByTheNextWriteAlone) {
  driver.start();
  ring.broken = true;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  ASSERT_TRUE(next());
  ring.set_report({.ok = true, .message = {}, .note = {}, .writes = 0});
  std::this_thread::sleep_for(std::chrono::milliseconds(600));  // in which it is looked at twice
  EXPECT_TRUE(driver.trouble());
  EXPECT_EQ(driver.message(), "the fake ring is broken: fix it");
}

TEST_F(LightDriverTest, ALightAskedForWhileTheRingIsAwayIsShownWhenItComes) {
  ring.away = true;
  driver.start();
  EXPECT_TRUE(driver.trouble());
  EXPECT_EQ(driver.message(), "the fake ring is away: plug it in");
  ASSERT_TRUE(driver.submit({SetLight{dimmed(50)}}));
  ASSERT_TRUE(next());
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  const auto done = std::get<CommandDone>(next().value());
  EXPECT_EQ(done.outcome, Outcome::ring_away);
  EXPECT_EQ(done.message,
            "the fake ring is away: plug it in. The light is kept and shown when the ring is back");
  EXPECT_EQ(driver.light().brightness, 200);
  EXPECT_TRUE(ring.all().empty());
  ring.away = false;
  EXPECT_EQ(std::get<LightChanged>(next().value()).light.brightness, 100);
  ASSERT_EQ(ring.all().size(), 1U);
  EXPECT_EQ(ring.all()[0].brightness, 100);
  EXPECT_FALSE(driver.trouble());
  EXPECT_EQ(driver.message(), "");
  driver.stop();
  take_notes();
  for (std::size_t i = 0; i + 1 < notes.size(); ++i) EXPECT_FALSE(notes[i].returned) << i;
  EXPECT_TRUE(notes.back().returned);
  EXPECT_EQ(notes.back().light.brightness, 100);
}

TEST_F(LightDriverTest, ARingThatWentAndCameShowsItsLightAgain) {
  driver.start();
  ring.broken = true;  // the last write fails before the ring is away
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  ASSERT_TRUE(next());
  ring.away = true;
  EXPECT_TRUE(eventually([&] { return driver.message() == "the fake ring is away: plug it in"; }));
  ring.away = false;  // the ring is found but does not work yet
  EXPECT_TRUE(eventually([&] { return driver.message() == "the fake ring is broken: fix it"; }));
  ring.broken = false;
  EXPECT_TRUE(eventually([&] { return !driver.trouble(); }));
  ASSERT_EQ(ring.all().size(), 2U);
  EXPECT_EQ(ring.all()[1].brightness, 200);
  EXPECT_EQ(driver.message(), "");
  driver.stop();
  take_notes();
  EXPECT_TRUE(notes.back().returned);
}

// A partial update builds on this light.
TEST_F(LightDriverTest, TheRequestedLightIsTheLastOneThatTheRingDidNotFailToShow) {
  EXPECT_EQ(driver.requested().brightness, 200);
  ASSERT_TRUE(driver.submit({SetLight{dimmed(10)}}));
  ASSERT_TRUE(driver.submit({SetLight{dimmed(20)}}));
  EXPECT_EQ(driver.requested().brightness, 20) << "though it is not shown yet";
  ring.broken = true;
  driver.start();
  ASSERT_TRUE(next());
  ASSERT_TRUE(next());
  EXPECT_EQ(driver.requested().brightness, 200) << "what is shown";
  ring.broken = false;
  ring.away = true;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(30)}}));
  ASSERT_TRUE(next());
  EXPECT_EQ(driver.requested().brightness, 30) << "kept for the ring";
}

TEST_F(LightDriverTest, RefusesWhenTooManyWait) {
  for (int i = 0; i < 16; ++i) ASSERT_TRUE(driver.submit({SetLight{dimmed(i)}}));  // not started
  EXPECT_FALSE(driver.submit({SetLight{dimmed(0)}}));
}

TEST_F(LightDriverTest, StopsWhileItsQueuesAreFull) {
  driver.start();
  for (int i = 0; i < 16; ++i) ASSERT_TRUE(driver.submit({SetLight{dimmed(i)}}));
  // The first light and seven more fill the 16 places for notes; the next one waits.
  for (int i = 0; i < 5000 && ring.all().size() < 8; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // it tries four times meanwhile
  EXPECT_EQ(ring.all().size(), 8U);
  driver.stop();
  take_notes();
  EXPECT_EQ(notes.size(), 16U);
}

TEST_F(LightDriverTest, ReportsSinceWhenFramesAreExposedUnderALight) {
  exchange.sequence = 41;
  driver.start();
  EXPECT_EQ(driver.light_since_ns(), std::nullopt) << "no frame yet: its time stamps are unknown";
  exchange.light_lag_ns = 1000;
  take_notes();
  ASSERT_EQ(notes.size(), 2U);
  EXPECT_EQ(driver.light_since_ns(), notes[1].at_ns + 1000);
  const std::int64_t wall_before = base::system_clock().wall_ns();
  ASSERT_TRUE(driver.submit({SetLight{dimmed(100)}}));
  const auto done = std::get<CommandDone>(next().value());
  const auto changed = std::get<LightChanged>(next().value());
  take_notes();
  ASSERT_EQ(notes.size(), 4U);
  EXPECT_EQ(done.light_since_ns, notes[3].at_ns + 1000);
  EXPECT_EQ(changed.since_ns, notes[3].at_ns + 1000);
  EXPECT_EQ(changed.at.monotonic_ns, notes[3].at_ns);
  EXPECT_EQ(changed.at.sequence, 41U);
  EXPECT_GE(changed.at.wall_ns, wall_before - 1'000'000);
  EXPECT_LE(changed.at.wall_ns, base::system_clock().wall_ns());
  ring.broken = true;
  ASSERT_TRUE(driver.submit({SetLight{dimmed(50)}}));
  ASSERT_TRUE(next());
  EXPECT_EQ(driver.light_since_ns(), std::nullopt) << "what it shows is not known";
}

}  // namespace
}  // namespace dtact::pipeline
// NOLINTEND(bugprone-unchecked-optional-access)
