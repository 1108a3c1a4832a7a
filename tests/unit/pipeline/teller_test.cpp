#include "daemon/pipeline/teller.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <variant>

// A missing value ends the test by the exception of its access.
// NOLINTBEGIN(bugprone-unchecked-optional-access)
namespace dtact::pipeline {
namespace {

class TellerTest : public ::testing::Test {
 protected:
  /// Fills the queue with contact changes nobody reads.
  void fill() {
    while (exchange.reports.room() > 0) ASSERT_TRUE(exchange.reports.push(Answer{}));
  }
  std::optional<Report> next() {
    Report report;
    if (!exchange.reports.pop(report)) return std::nullopt;
    return report;
  }
  void drain() {
    while (next()) {
    }
  }
  static DepthFrame frame(bool touching, std::uint64_t sequence) {
    DepthFrame made;
    made.camera.sequence = sequence;
    made.contact.touching = touching;
    return made;
  }
  Exchange exchange{DepthFrame{}};
  Teller teller{exchange};
};

TEST_F(TellerTest, TellsChangesOnly) {
  teller.contact(frame(false, 1));
  EXPECT_FALSE(next());
  teller.contact(frame(true, 2));
  teller.contact(frame(true, 3));
  const auto made = next();
  ASSERT_TRUE(made);
  EXPECT_TRUE(std::get<ContactChanged>(*made).touching);
  EXPECT_EQ(std::get<ContactChanged>(*made).sequence, 2U);
  EXPECT_FALSE(next());
  teller.contact(frame(false, 4));
  EXPECT_FALSE(std::get<ContactChanged>(next().value()).touching);
}

TEST_F(TellerTest, TheFirstStateIsAlwaysTold) {
  teller.state(State::settling, {});
  teller.state(State::settling, {});
  ASSERT_TRUE(next());
  EXPECT_FALSE(next());
  HealthSet health;
  health.set(Health::frames_lost);
  teller.state(State::settling, health);
  EXPECT_TRUE(std::get<StateChanged>(next().value()).health.has(Health::frames_lost));
}

TEST_F(TellerTest, WhatDoesNotFitIsToldLater) {
  fill();
  teller.contact(frame(true, 7));
  teller.state(State::serving, {});
  teller.reference({.sequence = 8, .restored = true});
  teller.answer({.ticket = 9});
  teller.flush();
  EXPECT_TRUE(teller.answer_due());
  drain();
  teller.flush();
  EXPECT_FALSE(teller.answer_due());
  EXPECT_EQ(std::get<Answer>(next().value()).ticket, 9U);
  EXPECT_EQ(std::get<ReferenceTaken>(next().value()).sequence, 8U);
  EXPECT_FALSE(next());
  teller.contact(frame(true, 10));  // the next frames carry the rest
  teller.state(State::serving, {});
  EXPECT_EQ(std::get<ContactChanged>(next().value()).sequence, 10U);
  EXPECT_EQ(std::get<StateChanged>(next().value()).state, State::serving);
}

}  // namespace
}  // namespace dtact::pipeline
// NOLINTEND(bugprone-unchecked-optional-access)
