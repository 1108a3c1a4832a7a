#include "hal/ws2812/ring.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

namespace dtact::hal::ws2812 {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// Requests to a wire, kept beyond the ring's life.
struct Record {
  std::mutex mutex;
  std::vector<std::vector<Rgb>> writes;
  std::string error;
  std::string refusal;
  std::string note;
  std::string absence;            // why the wire cannot be opened; empty = it can
  std::atomic<bool> lost{false};  // the failed device stays unusable
  std::atomic<int> opened{0};     // wires opened so far
  std::atomic<int> open{0};       // wires open now
  std::atomic<int> powered{0};    // times the power was switched on

  std::vector<std::vector<Rgb>> all() {
    const std::lock_guard lock(mutex);
    return writes;
  }
  void be_absent(std::string sentence) {
    const std::lock_guard lock(mutex);
    absence = std::move(sentence);
  }
  void fail_with(std::string sentence) {
    const std::lock_guard lock(mutex);
    error = std::move(sentence);
  }
};

class RecordingWire final : public Wire {
 public:
  explicit RecordingWire(std::shared_ptr<Record> record) : record_(std::move(record)) {
    ++record_->opened;
    ++record_->open;
  }
  ~RecordingWire() override { --record_->open; }
  [[nodiscard]] std::string prepare(int /*leds*/) override { return record_->refusal; }
  [[nodiscard]] std::string note() const override { return record_->note; }
  [[nodiscard]] std::string send(std::span<const Rgb> leds) override {
    const std::lock_guard lock(record_->mutex);
    record_->writes.emplace_back(leds.begin(), leds.end());
    return record_->error;
  }
  [[nodiscard]] bool lost() const override { return record_->lost; }

 private:
  std::shared_ptr<Record> record_;
};

class IdleLine final : public gpiod::OutputLine {
 public:
  [[nodiscard]] int set(bool /*active*/) noexcept override { return 0; }
};

/// No re-sends unless a test asks for them.
Ws2812Config quiet() {
  Ws2812Config config;
  config.resend_ms = 0;
  return config;
}

std::unique_ptr<Ring> ring(const std::shared_ptr<Record>& record, const Ws2812Config& config) {
  const auto open = [record]() -> std::unique_ptr<Wire> {
    const std::lock_guard lock(record->mutex);
    if (!record->absence.empty()) throw std::runtime_error(record->absence);
    return std::make_unique<RecordingWire>(record);
  };
  const auto power = [record]() -> std::unique_ptr<gpiod::PowerSwitch> {
    ++record->powered;
    return std::make_unique<gpiod::PowerSwitch>(std::make_unique<IdleLine>(), 0);
  };
  return std::make_unique<Ring>(RingParts{{"recording", "here"}, open, power}, config);
}

/// Waits generously for an effect of another thread.
template <typename Condition>
bool eventually(Condition condition) {
  for (int i = 0; i < 2000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

const Light kRed{Light::all({255, 0, 0}), 255};

TEST(Ws2812Ring, WritesWhatItIsReportedAndGoesDarkAtTheEnd) {
  const auto record = std::make_shared<Record>();
  {
    const auto ours = ring(record, quiet());
    EXPECT_TRUE(record->all().empty()) << "nothing is written before it is asked for";
    EXPECT_TRUE(ours->show(kRed).ok);
    EXPECT_EQ(record->all().size(), 1U);
  }
  ASSERT_EQ(record->writes.size(), 2U);
  EXPECT_EQ(record->writes[0], std::vector<Rgb>(8, Rgb{255, 0, 0}));
  EXPECT_EQ(record->writes[1], std::vector<Rgb>(8, Rgb{0, 0, 0}));
}

TEST(Ws2812Ring, StaysOnWhenAskedTo) {
  const auto record = std::make_shared<Record>();
  Ws2812Config config = quiet();
  config.leave_on = true;
  (void)ring(record, config)->show(kRed);
  EXPECT_EQ(record->writes.size(), 1U);
}

TEST(Ws2812Ring, GoesDarkAtTheEndThoughNothingWasShown) {
  const auto record = std::make_shared<Record>();
  (void)ring(record, quiet());
  ASSERT_EQ(record->writes.size(), 1U);
  EXPECT_EQ(record->writes[0], std::vector<Rgb>(8, Rgb{0, 0, 0}));
}

TEST(Ws2812Ring, ReSendsTheLightItIsGiven) {
  const auto record = std::make_shared<Record>();
  Ws2812Config config = quiet();
  config.resend_ms = 2;
  const auto ours = ring(record, config);
  (void)ours->show(Light{Light::all({1, 1, 1}), 255});
  (void)ours->show(kRed);
  const std::size_t before = record->all().size();
  const auto began = std::chrono::steady_clock::now();
  while (record->all().size() < before + 5) {
    const RingReport report = ours->attend(kRed);
    EXPECT_LE(report.due, std::chrono::milliseconds(2));
    std::this_thread::sleep_for(report.due);
  }
  EXPECT_GE(std::chrono::steady_clock::now() - began, std::chrono::milliseconds(8));
  EXPECT_EQ(record->all().back(), std::vector<Rgb>(8, Rgb{255, 0, 0}));
}

// resend_ms = 0 is never. An hour is the longest that can be configured.
TEST(Ws2812Ring, WritesOnceWhatIsNotDueAgain) {
  for (const int resend_ms : {0, 3'600'000}) {
    const auto record = std::make_shared<Record>();
    Ws2812Config config = quiet();
    config.resend_ms = resend_ms;
    const auto ours = ring(record, config);
    (void)ours->show(kRed);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(ours->attend(kRed).due, std::chrono::milliseconds(250)) << resend_ms;
    }
    EXPECT_EQ(record->all().size(), 1U) << resend_ms;
    EXPECT_EQ(ours->attend(kRed).writes, 1U) << resend_ms;
    EXPECT_EQ(record->opened, 1) << "a ring that is there is not looked for";
  }
}

TEST(Ws2812Ring, AFailedWriteIsTheCommandsErrorAndHealsByItself) {
  const auto record = std::make_shared<Record>();
  Ws2812Config config = quiet();
  config.resend_ms = 2;
  record->error = "the wire is cut: fix it";
  const auto ours = ring(record, config);
  const ShowResult result = ours->show(kRed);
  EXPECT_FALSE(result.ok);
  EXPECT_EQ(result.message, "the wire is cut: fix it");
  EXPECT_FALSE(ours->attend(kRed).ok);

  record->fail_with("");
  ASSERT_TRUE(eventually([&] { return ours->attend(kRed).ok; }));
  EXPECT_EQ(ours->attend(kRed).message, "");
  EXPECT_EQ(record->all().back(), std::vector<Rgb>(8, Rgb{255, 0, 0}));
}

TEST(Ws2812Ring, AReSendThatFailsShowsInTheReport) {
  const auto record = std::make_shared<Record>();
  Ws2812Config config = quiet();
  config.resend_ms = 2;
  const auto ours = ring(record, config);
  ASSERT_TRUE(ours->show(kRed).ok);
  record->fail_with("the wire is cut: fix it");
  ASSERT_TRUE(eventually([&] { return !ours->attend(kRed).ok; }));
  EXPECT_EQ(ours->attend(kRed).message, "the wire is cut: fix it");
}

TEST(Ws2812Ring, SaysWhenTheBudgetDimmed) {
  const auto record = std::make_shared<Record>();
  Ws2812Config config = quiet();
  config.current_budget_ma = 250;
  const auto ours = ring(record, config);
  const ShowResult white = ours->show(Light{});
  EXPECT_TRUE(white.ok);
  EXPECT_THAT(white.message, HasSubstr("dimmed to 51 %"));
  EXPECT_THAT(white.message, HasSubstr("current_budget_ma = 250"));
  const ShowResult red = ours->show(kRed);  // 8 · 20.7 mA
  EXPECT_EQ(red.message, "");
}

TEST(Ws2812Ring, SetsTheColoursInTheOrderOfTheChain) {
  const auto record = std::make_shared<Record>();
  Light light;
  for (std::uint8_t i = 0; i < 8; ++i) light.leds[i] = {i, 0, 0};
  const auto order = [&](int first, bool clockwise) {
    Ws2812Config config = quiet();
    config.first_led = first;
    config.clockwise = clockwise;
    (void)ring(record, config)->show(light);
    std::vector<int> reds;
    for (const Rgb& led : record->writes[record->writes.size() - 2]) reds.push_back(led.r);
    return reds;
  };
  EXPECT_THAT(order(0, true), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(order(2, true), ElementsAre(2, 3, 4, 5, 6, 7, 0, 1));
  EXPECT_THAT(order(0, false), ElementsAre(0, 7, 6, 5, 4, 3, 2, 1));
  EXPECT_THAT(order(5, false), ElementsAre(5, 4, 3, 2, 1, 0, 7, 6));
  EXPECT_THAT(order(7, true), ElementsAre(7, 0, 1, 2, 3, 4, 5, 6));
}

TEST(Ws2812Ring, AnAbsentRingIsLookedForAndWorksOnceItIsThere) {
  const auto record = std::make_shared<Record>();
  record->absence = "/dev/here: No such file or directory: turn it on";
  const auto ours = ring(record, quiet());
  EXPECT_EQ(ours->info().identity, "here");
  EXPECT_TRUE(ours->attend(kRed).away);
  EXPECT_FALSE(ours->attend(kRed).ok);
  EXPECT_EQ(ours->attend(kRed).message, "/dev/here: No such file or directory: turn it on");
  const ShowResult early = ours->show(kRed);
  EXPECT_FALSE(early.ok);
  EXPECT_TRUE(early.away);
  EXPECT_EQ(early.message, "/dev/here: No such file or directory: turn it on");
  EXPECT_EQ(record->powered, 0);

  record->be_absent("");
  ASSERT_TRUE(eventually([&] { return !ours->attend(kRed).away; }));
  EXPECT_TRUE(ours->attend(kRed).ok);
  EXPECT_EQ(ours->attend(kRed).message, "");
  EXPECT_EQ(record->powered, 1);
  EXPECT_TRUE(record->all().empty()) << "nothing is written before it is asked for";
  EXPECT_TRUE(ours->show(kRed).ok);
  EXPECT_EQ(record->all().back(), std::vector<Rgb>(8, Rgb{255, 0, 0}));
}

TEST(Ws2812Ring, AnAbsentRingStaysUnchangedAtTheEnd) {
  const auto record = std::make_shared<Record>();
  record->absence = "not there";
  (void)ring(record, quiet())->show(kRed);
  EXPECT_TRUE(record->writes.empty());
}

TEST(Ws2812Ring, AWireThatIsLostIsClosedAndOpenedAnew) {
  const auto record = std::make_shared<Record>();
  Ws2812Config config = quiet();
  config.resend_ms = 2;
  const auto ours = ring(record, config);
  ASSERT_TRUE(ours->show(kRed).ok);
  record->be_absent("/dev/here is gone");
  record->lost = true;
  record->fail_with("shut down");
  ASSERT_TRUE(eventually([&] { return ours->attend(kRed).message == "/dev/here is gone"; }));
  EXPECT_TRUE(ours->attend(kRed).away);
  EXPECT_EQ(record->open, 0) << "the device is free for another program";

  record->fail_with("");
  record->be_absent("");
  ASSERT_TRUE(eventually([&] { return ours->attend(kRed).ok; }));
  EXPECT_EQ(record->opened, 2);
  EXPECT_EQ(record->powered, 1) << "the LEDs kept their power and with it their light";
  const std::size_t before = record->all().size();
  ASSERT_TRUE(eventually([&] { return ours->attend(kRed).ok && record->all().size() > before; }));
  EXPECT_EQ(record->all().back(), std::vector<Rgb>(8, Rgb{255, 0, 0}));
}

TEST(Ws2812Ring, AWireThatFailsIsKept) {
  const auto record = std::make_shared<Record>();
  Ws2812Config config = quiet();
  config.resend_ms = 2;
  const auto ours = ring(record, config);
  record->fail_with("a glitch");
  const ShowResult result = ours->show(kRed);
  EXPECT_FALSE(result.ok);
  EXPECT_FALSE(result.away);
  record->fail_with("");
  ASSERT_TRUE(eventually([&] { return ours->attend(kRed).ok; }));
  EXPECT_EQ(record->opened, 1);
}

TEST(Ws2812Ring, AWireThatRefusesIsAskedAgain) {
  const auto record = std::make_shared<Record>();
  record->refusal = "too slow: use SPI";
  const auto ours = ring(record, quiet());
  EXPECT_TRUE(ours->attend(kRed).away);
  EXPECT_EQ(ours->show(kRed).message, "too slow: use SPI");
  ASSERT_TRUE(eventually([&] { return ours->attend(kRed).away && record->opened >= 2; }));
  EXPECT_TRUE(record->all().empty());
}

TEST(Ws2812Ring, ANoteOfTheWireIsReported) {
  const auto record = std::make_shared<Record>();
  record->note = "a little slow";
  EXPECT_EQ(ring(record, quiet())->attend(kRed).note, "a little slow");
}

TEST(Ws2812Ring, SettingsThatMakeNoSenseStopTheStart) {
  const auto record = std::make_shared<Record>();
  Ws2812Config config = quiet();
  config.first_led = 8;
  EXPECT_THROW((void)ring(record, config), std::invalid_argument);
  config.first_led = -1;
  EXPECT_THROW((void)ring(record, config), std::invalid_argument);
  config = quiet();
  config.current_budget_ma = 0;
  EXPECT_THROW((void)ring(record, config), std::invalid_argument);
  EXPECT_TRUE(record->writes.empty());
}

}  // namespace
}  // namespace dtact::hal::ws2812
