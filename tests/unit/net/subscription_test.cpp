#include "daemon/serve/subscription.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

using testing::HasSubstr;

constexpr double kPeriodNs = 1e9 / 60;

/// The n-th frame of a camera of 60 frames a second, some time after its machine's start.
std::int64_t at(int frame) { return 1'000'000'000 + std::llround(frame * kPeriodNs); }

/// 'x' for each of `frames` frames that passes; each is late or early by `jitter_ns` in turn.
std::string let_through(double hz, int frames, std::int64_t jitter_ns = 0) {
  RateLimit limit(hz);
  std::string pattern;
  std::int64_t last_ns = 0;
  for (int i = 0; i < frames; ++i) {
    const std::int64_t now_ns = at(i) + (i % 2 == 0 ? jitter_ns : -jitter_ns);
    pattern += limit.admits(now_ns, i == 0 ? 0 : now_ns - last_ns) ? 'x' : '.';
    last_ns = now_ns;
  }
  return pattern;
}

TEST(RateLimit, LetsEveryFrameThroughWithoutOne) {
  EXPECT_EQ(let_through(0, 6), "xxxxxx");
  EXPECT_EQ(let_through(1000, 6), "xxxxxx");
  EXPECT_EQ(let_through(60, 6), "xxxxxx");
}

TEST(RateLimit, OfAWholeFractionTakesEveryNthFrame) {
  EXPECT_EQ(let_through(30, 8), "x.x.x.x.");
  EXPECT_EQ(let_through(20, 9), "x..x..x..");
  EXPECT_EQ(let_through(10, 13), "x.....x.....x");
}

TEST(RateLimit, OfAnyOtherRateTakesTheNearestFrames) {
  EXPECT_EQ(let_through(45, 12), "xx.xxx.xxx.x");
  EXPECT_EQ(let_through(25, 13), "x.x..x.x..x.x");  // 5 of 12
}

TEST(RateLimit, JitterMakesItNeitherMoreNorUneven) {
  EXPECT_EQ(let_through(30, 8, 2'500'000), "x.x.x.x.");
  EXPECT_EQ(let_through(30, 8, -2'500'000), "x.x.x.x.");
}

TEST(RateLimit, IsNeverExceededOverALongTime) {
  for (const double hz : {0.5, 7.0, 24.0, 29.97, 45.0, 59.0}) {
    const std::string pattern = let_through(hz, 6001, 2'000'000);  // 100 s
    EXPECT_NEAR(static_cast<double>(std::count(pattern.begin(), pattern.end(), 'x')), 100 * hz + 1,
                1)
        << hz;
  }
}

TEST(RateLimit, APauseIsNotMadeUpFor) {
  RateLimit limit(1);
  EXPECT_TRUE(limit.admits(at(0), 0));
  EXPECT_TRUE(limit.admits(at(600), at(600) - at(0)));
  for (int i = 601; i < 657; ++i) EXPECT_FALSE(limit.admits(at(i), at(i) - at(i - 1))) << i;
  EXPECT_TRUE(limit.admits(at(660), at(1) - at(0)));
}

// dtact-perceive keeps its clients while the daemon's machine restarts, and its clock with it.
TEST(RateLimit, BeginsAnewWithAnotherClock) {
  constexpr std::int64_t kTenDaysNs = 864'000'000'000'000;
  RateLimit limit(10);
  EXPECT_TRUE(limit.admits(kTenDaysNs, 0));
  EXPECT_TRUE(limit.admits(at(0), 0));
  EXPECT_FALSE(limit.admits(at(1), at(1) - at(0)));
  EXPECT_TRUE(limit.admits(at(6), at(6) - at(5)));
}

Subscription made(const v1::Subscribe& request) {
  auto result = Subscription::from(request, {});
  return std::get<Subscription>(std::move(result));
}

/// The parts of `frames` frames at 60 a second: d, l, j, s for each, '.' for no message.
std::string parts_of(Subscription subscription, int frames) {
  std::string text;
  for (int i = 0; i < frames; ++i) {
    const auto parts = subscription.next(at(i), 0).parts;
    text += i == 0 ? "" : " ";
    if (parts == 0) text += '.';
    if ((parts & Subscription::kDepth) != 0) text += 'd';
    if ((parts & Subscription::kLuma) != 0) text += 'l';
    if ((parts & Subscription::kJpeg) != 0) text += 'j';
    if ((parts & Subscription::kSummary) != 0) text += 's';
  }
  return text;
}

TEST(Subscription, SendsEachPartAtItsOwnRate) {
  v1::Subscribe request;
  request.set_depth(v1::DEPTH_INT16);
  request.set_depth_hz(30);
  request.set_luma(v1::LUMA_GREY8);
  request.set_luma_hz(20);
  request.set_jpeg(true);
  request.set_jpeg_hz(10);
  EXPECT_EQ(parts_of(made(request), 7), "dlj . d l d . dlj");
  request.set_summary(true);
  EXPECT_EQ(parts_of(made(request), 7), "dljs s ds ls ds s dljs");
}

TEST(Subscription, LimitsWhatEveryLeaves) {
  v1::Subscribe request;
  request.set_depth(v1::DEPTH_INT16);
  request.set_every(2);
  request.set_depth_hz(15);
  EXPECT_EQ(parts_of(made(request), 9), "d . . . d . . . d");
}

TEST(Subscription, OfALimitedPartNoFrameIsMissed) {
  v1::Subscribe request;
  request.set_depth(v1::DEPTH_INT16);
  request.set_depth_hz(30);
  Subscription limited = made(request);
  EXPECT_EQ(limited.next(at(0), 0).missed, 0U);
  EXPECT_EQ(limited.next(at(4), 3).missed, 0U);
  request.set_summary(true);
  Subscription every = made(request);
  EXPECT_EQ(every.next(at(0), 0).missed, 0U);
  EXPECT_EQ(every.next(at(4), 3).missed, 3U);
}

TEST(Subscription, OfNothingIsNeverDue) {
  EXPECT_EQ(parts_of(made({}), 3), ". . .");
  EXPECT_TRUE(made({}).events());
  v1::Subscribe request;
  request.set_events(false);
  EXPECT_FALSE(made(request).events());
  request.set_events(true);
  EXPECT_TRUE(made(request).events());
}

TEST(Subscription, ASummaryComesBesideTheMaps) {
  v1::Subscribe request;
  request.set_depth(v1::DEPTH_INT16);
  request.set_luma(v1::LUMA_GREY8);
  request.set_summary(true);
  EXPECT_EQ(parts_of(made(request), 2), "dls dls");
}

TEST(Subscription, KindsHoldWhatIsDueOnly) {
  v1::Subscribe request;
  request.set_depth(v1::DEPTH_PREDICT_ZSTD);
  request.set_luma(v1::LUMA_GREY8);
  request.set_decimation(2);
  request.set_um_per_unit(5);
  request.mutable_box()->set_x(10);
  request.mutable_box()->set_y(20);
  request.mutable_box()->set_width(30);
  request.mutable_box()->set_height(40);
  const Subscription subscription = made(request);
  EXPECT_EQ(
      subscription.kind(Subscription::kDepth),
      (FrameKind{
          .depth = 2,
          .spec = {.decimation = 2, .um_per_unit = 5, .region = DepthRegion{10, 20, 30, 40}}}));
  EXPECT_EQ(subscription.kind(Subscription::kLuma), (FrameKind{.luma = 1}));
  EXPECT_EQ(subscription.kind(Subscription::kSummary), FrameKind{});
  request.set_contact_box(true);
  EXPECT_EQ(
      made(request).kind(Subscription::kDepth),
      (FrameKind{.depth = 2, .spec = {.decimation = 2, .um_per_unit = 5}, .contact_box = true}));
}

void expect_refused(const v1::Subscribe& request, v1::ErrorCode code, const std::string& part) {
  const auto result = Subscription::from(request, {.width = 580, .height = 580});
  const auto* refusal = std::get_if<Refusal>(&result);
  ASSERT_NE(refusal, nullptr) << part;
  EXPECT_EQ(refusal->code, code) << part;
  EXPECT_THAT(refusal->sentence, HasSubstr(part));
}

TEST(Subscription, RefusesRatesOutOfRangeByName) {
  for (const double hz :
       {-1.0, 0.009, 1000.1, std::nan(""), std::numeric_limits<double>::infinity()}) {
    v1::Subscribe request;
    request.set_depth_hz(hz);
    expect_refused(request, v1::ERROR_INVALID, "subscribe.depth_hz");
    request.Clear();
    request.set_luma_hz(hz);
    expect_refused(request, v1::ERROR_INVALID, "subscribe.luma_hz");
    request.Clear();
    request.set_jpeg_hz(hz);
    expect_refused(request, v1::ERROR_INVALID, "subscribe.jpeg_hz");
    request.Clear();
    request.set_summary_hz(hz);
    expect_refused(request, v1::ERROR_INVALID, "subscribe.summary_hz");
  }
  v1::Subscribe request;
  for (const double hz : {0.0, 0.01, 1000.0}) {
    request.set_depth_hz(hz);
    EXPECT_EQ(Subscription::from(request, {}).index(), 0U) << hz;
  }
}

/// Each rate by its name in dtact.proto.
const std::vector<std::pair<std::string, void (*)(v1::Subscribe&, double)>> kRates{
    {"depth_hz", [](v1::Subscribe& request, double hz) { request.set_depth_hz(hz); }},
    {"luma_hz", [](v1::Subscribe& request, double hz) { request.set_luma_hz(hz); }},
    {"jpeg_hz", [](v1::Subscribe& request, double hz) { request.set_jpeg_hz(hz); }},
    {"summary_hz", [](v1::Subscribe& request, double hz) { request.set_summary_hz(hz); }},
    {"cloud_hz", [](v1::Subscribe& request, double hz) { request.set_cloud_hz(hz); }},
    {"pose_hz", [](v1::Subscribe& request, double hz) { request.set_pose_hz(hz); }},
    {"recognition_hz", [](v1::Subscribe& request, double hz) { request.set_recognition_hz(hz); }}};

TEST(Subscription, EveryRateHasTheSameRange) {
  for (const auto& [name, set] : kRates) {
    v1::Subscribe request;
    for (const double hz : {0.0, 0.01, 1000.0}) {
      set(request, hz);
      EXPECT_EQ(Subscription::from(request, {}).index(), 0U) << name << " " << hz;
    }
    for (const double hz : {-0.01, 0.0099, 1000.01}) {
      set(request, hz);
      expect_refused(request, v1::ERROR_INVALID,
                     "subscribe." + name + ": " + fmt::format("{}", hz) +
                         "; allowed are 0 (no limit) and 0.01 to 1000");
    }
  }
}

/// What dtact-perceive sends of 13 frames of a subscription.
std::string geometry_of(const v1::Subscribe& request) {
  auto subscription = std::get<Subscription>(Subscription::from(request, {}, Serves::geometry));
  std::string text;
  for (int i = 0; i < 13; ++i) {
    const auto parts = subscription.next(at(i), 0).parts;
    text += i == 0 ? "" : " ";
    if (parts == 0) text += '.';
    if ((parts & Subscription::kCloud) != 0) text += 'c';
    if ((parts & Subscription::kPose) != 0) text += 'p';
    if ((parts & Subscription::kRecognition) != 0) text += 'r';
  }
  return text;
}

TEST(Subscription, EveryPartOfPerceiveHasItsOwnRate) {
  v1::Subscribe request;
  request.set_cloud(v1::CLOUD_INT16);
  request.set_cloud_hz(30);
  request.set_pose(true);
  request.set_pose_hz(20);
  request.set_recognition(true);
  request.set_recognition_hz(10);
  EXPECT_EQ(geometry_of(request), "cpr . c p c . cpr . c p c . cpr");
}

// A sensor's map is rarely square.
TEST(Subscription, ABoxBeginsWithinTheMap) {
  constexpr Subscription::Map kMap{.width = 500, .height = 400};
  v1::Subscribe request;
  auto& box = *request.mutable_box();
  box.set_width(1);
  box.set_height(1);
  for (const auto& [x, y] : {std::pair{0U, 0U}, {499U, 0U}, {0U, 399U}, {499U, 399U}}) {
    box.set_x(x);
    box.set_y(y);
    EXPECT_EQ(Subscription::from(request, kMap).index(), 0U) << x << ", " << y;
  }
  for (const auto& [x, y] : {std::pair{500U, 0U}, {0U, 400U}, {0U, 450U}, {4294967295U, 1U}}) {
    box.set_x(x);
    box.set_y(y);
    const auto result = Subscription::from(request, kMap);
    const auto* refusal = std::get_if<Refusal>(&result);
    ASSERT_NE(refusal, nullptr) << x << ", " << y;
    EXPECT_THAT(
        refusal->sentence,
        HasSubstr(fmt::format("begins at {}, {}, and the depth map has 500x400 pixels", x, y)));
    EXPECT_EQ(Subscription::from(request, {}).index(), 0U) << "no map is known yet";
  }
}

TEST(Subscription, TakesEveryDecimationUnitAndNumberOfPresses) {
  for (const std::uint32_t decimation : {1U, 2U, 4U}) {
    for (const std::uint32_t um : {1U, 2U, 5U, 10U}) {
      v1::Subscribe request;
      request.set_depth(v1::DEPTH_INT16);
      request.set_decimation(decimation);
      request.set_um_per_unit(um);
      const DepthSpec spec = made(request).kind(Subscription::kDepth).spec;
      EXPECT_EQ(spec.decimation, static_cast<int>(decimation));
      EXPECT_EQ(spec.um_per_unit, static_cast<int>(um));
    }
  }
  EXPECT_EQ(made({}).kind(Subscription::kDepth).spec, (DepthSpec{1, 1}));
  for (const auto& [presses, joined] : {std::pair{0U, 1}, {1U, 1}, {10U, 10}}) {
    v1::Subscribe request;
    request.set_recognition(true);
    request.set_recognition_presses(presses);
    const auto from = Subscription::from(request, {}, Serves::geometry);
    ASSERT_TRUE(std::holds_alternative<Subscription>(from)) << presses;
    EXPECT_EQ(std::get<Subscription>(from).kind(Subscription::kRecognition).recognition, joined);
  }
}

TEST(Subscription, RefusesOtherDecimationsUnitsAndBoxes) {
  v1::Subscribe request;
  request.set_decimation(3);
  expect_refused(request, v1::ERROR_INVALID, "subscribe.decimation: 3");
  request.Clear();
  request.set_um_per_unit(3);
  expect_refused(request, v1::ERROR_INVALID, "subscribe.um_per_unit: 3");
  request.Clear();
  request.mutable_box()->set_height(1);
  expect_refused(request, v1::ERROR_INVALID, "subscribe.box: 0x1");
  request.mutable_box()->set_width(1);
  request.mutable_box()->set_height(0);
  expect_refused(request, v1::ERROR_INVALID, "subscribe.box: 1x0");
  request.mutable_box()->set_height(1);
  request.mutable_box()->set_x(580);
  expect_refused(request, v1::ERROR_INVALID, "580x580");
  request.mutable_box()->set_x(579);
  EXPECT_EQ(Subscription::from(request, {.width = 580, .height = 580}).index(), 0U);
}

TEST(Subscription, DoesNotSupportUnknownEncodings) {
  v1::Subscribe request;
  request.set_depth(static_cast<v1::DepthEncoding>(9));
  expect_refused(request, v1::ERROR_UNSUPPORTED,
                 "subscribe.depth: this daemon does not know encoding 9");
  request.set_depth(v1::DEPTH_NONE);
  request.set_luma(static_cast<v1::LumaEncoding>(9));
  expect_refused(request, v1::ERROR_UNSUPPORTED, "subscribe.luma");
}

TEST(Subscription, EachProgramServesItsOwnParts) {
  v1::Subscribe points;
  points.set_cloud(v1::CLOUD_INT16);
  points.set_cloud_hz(30);
  points.set_pose(true);
  points.set_contact_box(true);
  points.set_decimation(2);
  const auto of_perceive = Subscription::from(points, {}, Serves::geometry);
  ASSERT_TRUE(std::holds_alternative<Subscription>(of_perceive));
  const auto& made = std::get<Subscription>(of_perceive);
  EXPECT_EQ(made.parts(), Subscription::kCloud | Subscription::kPose);
  const FrameKind cloud = made.kind(Subscription::kCloud);
  EXPECT_EQ(cloud.cloud, v1::CLOUD_INT16);
  EXPECT_TRUE(cloud.contact_box);
  EXPECT_EQ(cloud.spec.decimation, 2);
  EXPECT_FALSE(cloud.pose);
  EXPECT_TRUE(made.kind(Subscription::kPose).pose);
  EXPECT_EQ(made.kind(Subscription::kPose).cloud, 0);
  EXPECT_EQ(made.kind(Subscription::kPose).recognition, 0);
  v1::Subscribe recognition;
  recognition.set_recognition(true);
  const auto recognised = Subscription::from(recognition, {}, Serves::geometry);
  EXPECT_EQ(std::get<Subscription>(recognised).kind(Subscription::kRecognition).recognition, 1);
  const auto code_of = [](const v1::Subscribe& request, Serves serves) {
    const auto from = Subscription::from(request, {}, serves);
    const auto* refusal = std::get_if<Refusal>(&from);
    return refusal == nullptr ? 0 : refusal->code;
  };
  EXPECT_EQ(code_of(points, Serves::images), v1::ERROR_UNSUPPORTED);
  EXPECT_EQ(code_of(recognition, Serves::images), v1::ERROR_UNSUPPORTED);
  recognition.set_recognition_presses(11);
  EXPECT_EQ(code_of(recognition, Serves::geometry), v1::ERROR_INVALID);
  v1::Subscribe depth;
  depth.set_depth(v1::DEPTH_INT16);
  EXPECT_EQ(code_of(depth, Serves::images), 0);
  EXPECT_EQ(code_of(depth, Serves::geometry), v1::ERROR_UNSUPPORTED);
  points.set_cloud_hz(2000);
  EXPECT_EQ(code_of(points, Serves::geometry), v1::ERROR_INVALID);
}

}  // namespace
}  // namespace dtact::net
