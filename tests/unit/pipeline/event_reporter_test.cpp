#include "daemon/pipeline/event_reporter.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <thread>
#include <variant>

// A missing value ends the test by the exception of its access.
// NOLINTBEGIN(bugprone-unchecked-optional-access)
namespace dtact::pipeline {
namespace {

class EventReporterTest : public ::testing::Test {
 protected:
  /// Fills the queue with contact changes that are not read.
  void fill() {
    while (exchange.events.room() > 0) ASSERT_TRUE(exchange.events.push(CommandDone{}));
  }
  std::optional<Event> next() {
    Event event;
    if (!exchange.events.pop(event)) return std::nullopt;
    return event;
  }
  void drain() {
    while (next()) {
    }
  }
  static DepthFrame frame(bool in_contact, std::uint64_t sequence) {
    DepthFrame made;
    made.camera.sequence = sequence;
    made.contact.in_contact = in_contact;
    return made;
  }
  Exchange exchange{DepthFrame{}};
  EventReporter reporter{exchange};
};

TEST_F(EventReporterTest, ReportsChangesOnly) {
  reporter.contact(frame(false, 1));
  EXPECT_FALSE(next());
  reporter.contact(frame(true, 2));
  reporter.contact(frame(true, 3));
  const auto made = next();
  ASSERT_TRUE(made);
  EXPECT_TRUE(std::get<ContactChanged>(*made).in_contact);
  EXPECT_EQ(std::get<ContactChanged>(*made).at.sequence, 2U);
  EXPECT_FALSE(next());
  reporter.contact(frame(false, 4));
  EXPECT_FALSE(std::get<ContactChanged>(next().value()).in_contact);
}

// A reference is being taken while an object is pressed in: the loss of contact is not known.
TEST_F(EventReporterTest, AFrameThatWasNotMeasuredReportsNothingOfContact) {
  reporter.contact(frame(true, 1));
  ASSERT_TRUE(next());
  DepthFrame blind = frame(false, 2);
  for (const ContactAbsence why : {ContactAbsence::referencing, ContactAbsence::uncalibrated}) {
    blind.contact_absence = why;
    reporter.contact(blind);
    EXPECT_FALSE(next());
  }
  reporter.contact(frame(true, 3));
  EXPECT_FALSE(next()) << "held all the time";
  DepthFrame lost = frame(false, 4);
  lost.camera.timestamp_ns = 5;
  lost.wall_ns = 6;
  reporter.contact(lost);
  const auto reported = std::get<ContactChanged>(next().value());
  EXPECT_FALSE(reported.in_contact);
  EXPECT_EQ(reported.at.sequence, 4U);
  EXPECT_EQ(reported.at.monotonic_ns, 5);
  EXPECT_EQ(reported.at.wall_ns, 6);
}

TEST_F(EventReporterTest, AContactThatNobodyListenedToBeginsForTheNextClient) {
  reporter.contact(frame(true, 1));
  ASSERT_TRUE(next());
  DepthFrame unasked = frame(false, 2);
  unasked.contact_absence = ContactAbsence::unasked;
  reporter.contact(unasked);
  EXPECT_FALSE(next()) << "no end, as nobody is there";
  reporter.contact(frame(true, 3));
  EXPECT_TRUE(std::get<ContactChanged>(next().value()).in_contact);
}

TEST_F(EventReporterTest, TheFirstStateIsAlwaysReported) {
  reporter.state(State::settling, {}, {.monotonic_ns = 0});
  reporter.state(State::settling, {}, {.monotonic_ns = 0});
  ASSERT_TRUE(next());
  EXPECT_FALSE(next());
  HealthSet health;
  health.set(Health::frames_lost);
  reporter.state(State::settling, health, {.monotonic_ns = 0});
  EXPECT_TRUE(std::get<StateChanged>(next().value()).health.has(Health::frames_lost));
}

TEST_F(EventReporterTest, BeyondTheLutIsReportedASecondLonger) {
  HealthSet beyond;
  beyond.set(Health::beyond_calibration);
  const auto reported = [this](HealthSet health, std::int64_t now_ns) {
    reporter.state(State::serving, health, {.monotonic_ns = now_ns});
    return exchange.health.load();
  };
  EXPECT_EQ(reported(beyond, 0), beyond.bits());
  EXPECT_EQ(std::get<StateChanged>(next().value()).health, beyond);
  EXPECT_EQ(reported({}, 500'000'000), beyond.bits());
  EXPECT_EQ(reported(beyond, 700'000'000), beyond.bits());
  EXPECT_EQ(reported({}, 1'699'999'999), beyond.bits());
  EXPECT_FALSE(next()) << "flicker is one event";
  EXPECT_EQ(reported({}, 1'700'000'000), 0U);
  EXPECT_TRUE(std::get<StateChanged>(next().value()).health.empty());
}

// A client that receives "depth flows again" asks for the status at once.
TEST_F(EventReporterTest, WhoHasReadTheEventReadsItInTheStatus) {
  constexpr int kChanges = 200;
  std::atomic<int> read{0};
  int contradictions = 0;
  std::thread network([&] {
    while (read < kChanges) {
      const auto report = next();
      if (!report) {
        std::this_thread::yield();
        continue;
      }
      const State now = exchange.state.load(std::memory_order_relaxed);
      if (std::get<StateChanged>(*report).state != now) ++contradictions;
      ++read;
    }
  });
  for (int i = 0; i < kChanges; ++i) {
    reporter.state(i % 2 == 0 ? State::serving : State::settling, {}, {.monotonic_ns = 0});
    while (read <= i) std::this_thread::yield();
  }
  network.join();
  EXPECT_EQ(contradictions, 0);
}

TEST_F(EventReporterTest, WhatDoesNotFitIsReportedLater) {
  fill();
  reporter.contact(frame(true, 7));
  reporter.state(State::serving, {}, {.monotonic_ns = 0});
  reporter.reference({.restored = true, .at = {.sequence = 8}});
  reporter.answer({.outcome = Outcome::camera_away});
  reporter.flush();
  EXPECT_TRUE(reporter.answer_due());
  drain();
  reporter.flush();
  EXPECT_FALSE(reporter.answer_due());
  EXPECT_EQ(std::get<CommandDone>(next().value()).outcome, Outcome::camera_away);
  EXPECT_EQ(std::get<ReferenceTaken>(next().value()).at.sequence, 8U);
  EXPECT_FALSE(next());
  reporter.contact(frame(true, 10));  // the next frames carry the rest
  reporter.state(State::serving, {}, {.monotonic_ns = 0});
  EXPECT_EQ(std::get<ContactChanged>(next().value()).at.sequence, 10U);
  EXPECT_EQ(std::get<StateChanged>(next().value()).state, State::serving);
}

}  // namespace
}  // namespace dtact::pipeline
// NOLINTEND(bugprone-unchecked-optional-access)
