#include "hal/ws2812/gpio_wire.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cerrno>

#include "tests/unit/ws2812/chain_model.hpp"
#include "tests/unit/ws2812/fakes.hpp"

namespace dtact::hal::ws2812 {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;

constexpr std::array<Rgb, 8> kLeds{Rgb{1, 2, 3},     Rgb{255, 0, 128},  Rgb{0, 0, 0},
                                   Rgb{85, 170, 15}, Rgb{0, 255, 0},    Rgb{7, 7, 7},
                                   Rgb{200, 0, 1},   Rgb{255, 255, 255}};
// drive(low), then two calls a bit.
constexpr int kCallsAWrite = 1 + 2 * 24 * 8;

struct Bench {
  Bench() { state.clock.read_cost = 20; }
  test::FakeLine::State state;
  GpioWire wire{std::make_unique<test::FakeLine>(state), "gpiochip0 line 7", 3, state.clock};

  test::ChainModel chain() const {
    test::ChainModel model;
    for (std::size_t i = 0; i + 1 < state.events.size(); ++i) {
      model.level(state.events[i].high,
                  static_cast<double>(state.events[i + 1].at - state.events[i].at));
    }
    model.level(false, 300'000);
    return model;
  }
};

TEST(Ws2812GpioWire, AFastBoardIsAcceptedAndTheLineStaysLowMeanwhile) {
  Bench bench;
  EXPECT_EQ(bench.wire.prepare(8), "");
  EXPECT_EQ(bench.wire.note(), "");
  for (const auto& event : bench.state.events) EXPECT_FALSE(event.high);
}

TEST(Ws2812GpioWire, ASlowBoardIsRefusedWithFiguresAndAdvice) {
  Bench bench;
  bench.state.cost_ns = 1000;  // a microsecond a call, as user space usually takes
  const std::string refused = bench.wire.prepare(8);
  EXPECT_THAT(refused, HasSubstr("gpiochip0 line 7: this board is too slow"));
  EXPECT_THAT(refused, HasSubstr("a 0's high pulse takes 1."));
  EXPECT_THAT(refused, HasSubstr("allowed are 0.20 … 0.40"));
  EXPECT_THAT(refused, HasSubstr("ring.backend = \"ws2812_spi\""));
}

TEST(Ws2812GpioWire, AChainShowsWhatWasClocked) {
  Bench bench;
  EXPECT_EQ(bench.wire.prepare(8), "");
  bench.state.events.clear();
  EXPECT_EQ(bench.wire.send(kLeds), "");
  EXPECT_EQ(bench.wire.resent(), 0U);
  const test::ChainModel chain = bench.chain();
  EXPECT_THAT(chain.shown(), ElementsAreArray(kLeds));
  EXPECT_EQ(chain.odd_pulses(), 0);
}

TEST(Ws2812GpioWire, ADisturbedWriteIsSeenAndSentAgain) {
  // An interruption while the line is high (even calls raise, after the first), while it is low.
  for (const int struck : {2, 100, 101, kCallsAWrite - 1}) {
    Bench bench;
    bench.state.stalls = {struck};
    EXPECT_EQ(bench.wire.send(kLeds), "");
    EXPECT_EQ(bench.wire.resent(), 1U) << struck;
    EXPECT_EQ(bench.state.calls, 2 * kCallsAWrite);
    EXPECT_THAT(bench.chain().shown(), ElementsAreArray(kLeds));
  }
}

TEST(Ws2812GpioWire, RetriesAreBounded) {
  Bench bench;
  for (int write = 0; write < 10; ++write) bench.state.stalls.push_back(write * kCallsAWrite + 50);
  EXPECT_THAT(bench.wire.send(kLeds), HasSubstr("disturbed 4 times in a row"));
  EXPECT_EQ(bench.state.calls, 4 * kCallsAWrite);
  EXPECT_EQ(bench.wire.resent(), 3U);
}

TEST(Ws2812GpioWire, NotesABoardThatIsDisturbedNowAndThen) {
  Bench bench;
  bench.state.stalls = {50};
  EXPECT_EQ(bench.wire.prepare(8), "");
  EXPECT_THAT(bench.wire.note(), HasSubstr("1 of 20 trial writes"));
}

TEST(Ws2812GpioWire, ALineThatCannotBeDrivenSaysSo) {
  Bench bench;
  bench.state.error = EPERM;
  EXPECT_THAT(bench.wire.prepare(8), HasSubstr("cannot be driven (Operation not permitted)"));
  EXPECT_THAT(bench.wire.send(kLeds), HasSubstr("cannot be driven"));
}

TEST(Ws2812GpioWire, NoLedsIsNothingToDo) {
  Bench bench;
  EXPECT_EQ(bench.wire.send({}), "");
}

}  // namespace
}  // namespace dtact::hal::ws2812
