#include "tests/accuracy/study/study.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/accuracy/study/bench.hpp"
#include "tests/accuracy/study/force.hpp"
#include "tests/accuracy/study/reading.hpp"
#include "tests/accuracy/study/rows.hpp"

namespace dtact::study {
namespace {

// An image whose darkening is a function of the place, mm from its centre.
template <typename Level>
Darkening image_of(const Level& level) {
  Darkening image{401, 401, 0.02, {}};
  for (int y = -200; y <= 200; ++y) {
    for (int x = -200; x <= 200; ++x) {
      image.levels.push_back(static_cast<std::uint8_t>(std::lround(level(0.02 * x, 0.02 * y))));
    }
  }
  return image;
}

// Two discs of 20 and 10 grey levels, 2 mm apart, on ground of 2 grey levels.
TEST(Reading, PillarsAreJudgedByTheWeaker) {
  const Darkening image = image_of([](double x, double y) {
    if (std::hypot(x - 1, y) < 0.5) return 20.0;
    return std::hypot(x + 1, y) < 0.5 ? 10.0 : 2.0;
  });
  // The centroid of the part above 4 levels is at 0.45 mm, on the stronger pillar's side; from
  // there the stronger reaches from 0.05 mm on and the weaker ends at −0.95 mm.
  const Pillars pillars = read_pillars(image, 2.0);
  EXPECT_NEAR(pillars.symmetry, 0.5, 0.05);
  EXPECT_NEAR(pillars.peak, 10, 0.5);
  EXPECT_NEAR(pillars.dip, 0.8, 0.03);
  EXPECT_TRUE(pillars.resolved());
}

TEST(Reading, WhatIsTooFaintIsNotResolved) {
  const Darkening faint =
      image_of([](double x, double y) { return std::hypot(std::abs(x) - 1, y) < 0.5 ? 2.0 : 0.0; });
  EXPECT_EQ(read_pillars(faint, 2.0).peak, 0);  // nothing exceeds 4 levels
  EXPECT_FALSE((Pillars{.dip = 0.9, .peak = 2.4}.resolved()));
  EXPECT_FALSE((Pillars{.dip = 0.26, .peak = 9}.resolved()));
  EXPECT_FALSE((Pillars{.dip = 0.4, .peak = 9, .dip_sd = 0.2}.resolved()));
  EXPECT_TRUE((Pillars{.dip = 0.4, .peak = 9, .dip_sd = 0.1}.resolved()));
}

// Darkening of 40 grey levels a millimetre of the ball's height above its contact's edge.
TEST(Reading, ALutOfAPerfectBallReadsAFlatDisc) {
  const auto ball = image_of([](double x, double y) {
    return 40 * std::max(std::sqrt(std::max(4 - x * x - y * y, 0.0)) - 1.4, 0.0);
  });
  const std::vector<KnownPress> presses = {{&ball, 0.6}};
  const StudyLut lut = make_lut(presses, 2);
  EXPECT_GE(lut.deepest_level, 23);
  EXPECT_NEAR(lut.depth_mm.at(20), 0.5, 0.002);
  const auto flat =
      image_of([](double x, double y) { return std::hypot(x, y) < 1.5 ? 20.0 : 0.0; });
  const FlatReading reading = read_flat(flat, lut);
  EXPECT_NEAR(reading.depth_mm, 0.45, 0.005);  // less the LUT's 0.05 at the threshold
  EXPECT_NEAR(reading.diameter_mm, 3.0, 0.06);
  EXPECT_NEAR(reading.side_mm, 3.0, 0.06);
}

TEST(Reading, APatchHasARadiusAndAMean) {
  const auto image = image_of([](double x, double y) { return std::hypot(x, y) < 1 ? 9.0 : 5.0; });
  const Patch patch = patch_above(image, 5);
  EXPECT_NEAR(patch.radius_mm, 1, 0.01);
  EXPECT_NEAR(patch.mean, 9, 0.1);
  EXPECT_EQ(patch_above(image, 9).radius_mm, 0);
}

TEST(Force, HertzsLawFindsItsOwnZero) {
  const std::array<double, 4> depths = {0.2, 0.3, 0.4, 0.5};
  std::vector<double> forces;
  for (const double d : depths) forces.push_back(2 * std::pow(d - 0.1, 1.5));
  EXPECT_NEAR(hertz_zero_mm(depths, forces), 0.1, 1e-9);
}

// A flat face on a linear gel: twice the depth, twice the force. And a ball on a gel is stiffer
// than on a half-space of the same modulus, 16/9 √(R d³) for ν = 0.5 (Hertz).
TEST(Force, IsLinearForAFlatFaceAndAboveHertzForABall) {
  const hal::sim::GelModel gel{.thickness_mm = 2};
  const std::array<double, 2> depths = {0.1, 0.2};
  const auto flat = force_over_modulus(gel, hal::sim::disc(1), depths);
  EXPECT_NEAR(flat[1] / flat[0], 2, 0.001);
  const auto ball = force_over_modulus(gel, hal::sim::ball(2), depths);
  EXPECT_GT(ball[1], 16.0 / 9 * std::sqrt(2 * std::pow(0.2, 3)));
}

TEST(Bench, AskewIsDeeperOnTheRight) {
  const hal::sim::Object upright = hal::sim::two_pillars(0.5, 2);
  const hal::sim::Object leaning = askew(upright, 2);
  const double lowest = 0.3 + lowest_of_askew(upright, 2);
  EXPECT_NEAR(lowest - leaning.height_mm(1, 0), 0.3 + 0.034921, 1e-6);  // tan 2° · 1 mm
  EXPECT_NEAR(lowest - leaning.height_mm(-1, 0), 0.3 - 0.034921, 1e-6);
  EXPECT_GT(leaning.height_mm(0, 0), 100);
}

// A small part of the study. On the built-in sensor pillars 2 mm apart are resolved, 1.1 mm
// not; leaning ones have a weaker side, and merge first where they are shallow.
TEST(Study, PillarsOnTwoMillimetres) {
  const Protocol protocol{.shapes = false,
                          .spacings_mm = {1.10, 2.00},
                          .depths_mm = {0.2, 0.3},
                          .tilts_deg = {2},
                          .leaning_spacings_mm = {2.00},
                          .leaning_depths_mm = {0.2, 0.3}};
  const auto results = measure({specimens(2).front()}, protocol);
  ASSERT_EQ(results.size(), 1U);
  const auto& pillars = results.front().pillars;
  ASSERT_EQ(pillars.size(), 6U);
  const auto find = [&](double spacing, double tilt, double depth) {
    return *std::ranges::find_if(pillars, [&](const PillarPress& p) {
      return p.spacing_mm == spacing && p.tilt_deg == tilt && p.depth_mm == depth;
    });
  };
  EXPECT_TRUE(find(2.00, 0, 0.3).seen.resolved());
  EXPECT_FALSE(find(1.10, 0, 0.3).seen.resolved());
  EXPECT_GT(find(2.00, 0, 0.3).seen.symmetry, 0.9);
  EXPECT_LT(find(2.00, 2, 0.3).seen.symmetry, 0.85);
  EXPECT_LT(find(2.00, 2, 0.2).seen.dip, find(2.00, 0, 0.2).seen.dip - 0.2);
  EXPECT_EQ(results.front().resolved_of_four(0), 1);
  EXPECT_NE(to_csv(results).find("2,built-in,pillars,2,2,0.3,dip,"), std::string::npos);
}

TEST(Study, EveryRowThatDisagreesSaysWhy) {
  const Result nothing{.law = "law", .thickness_mm = 2, .resolutions = {}, .pillars = {}};
  for (const Row& row : compare({nothing})) EXPECT_FALSE(row.remark.empty()) << row.what;
  const std::vector<Row> rows = {{"a", "1", {"1.1"}, true, "never shown"},
                                 {"b", "2", {"9"}, false, "because"}};
  const std::vector<std::string> laws = {"law"};
  const std::string table = to_markdown(rows, laws);
  EXPECT_NE(table.find("| a | 1 | 1.1 | yes | |\n"), std::string::npos);
  EXPECT_NE(table.find("| b | 2 | 9 | no | because |\n"), std::string::npos);
}

}  // namespace
}  // namespace dtact::study
