#include "clients/calibrate/fit/least_squares.hpp"

#include <gtest/gtest.h>

#include <tuple>

namespace dtact::calibration {
namespace {

TEST(BetweenKnots, PositionsOutsideBelongToTheOutermostPair) {
  for (const auto& [place, below, part] : {std::tuple{0.0, 0, 0.0},
                                           {1.25, 1, 0.25},
                                           {2.0, 2, 0.0},
                                           {3.0, 2, 1.0},
                                           {5.5, 2, 3.5},
                                           {-0.5, 0, -0.5}}) {
    const BetweenKnots found = between_knots(place, 4);
    EXPECT_EQ(found.below, below) << place;
    EXPECT_DOUBLE_EQ(found.part, part) << place;
  }
}

TEST(BetweenKnots, TheFunctionGoesOnAlongItsOutermostPairs) {
  const Eigen::VectorXd knots{{1, 3, 4, 8}};
  EXPECT_DOUBLE_EQ(value_at(knots, 0.5), 2);
  EXPECT_DOUBLE_EQ(value_at(knots, 2.25), 5);
  EXPECT_DOUBLE_EQ(value_at(knots, 4), 12);
  EXPECT_DOUBLE_EQ(value_at(knots, -1), -1);
}

// 2 a = 6 with the weight 3 and a = 5 with the weight 4: (3 · 2 · 6 + 4 · 5) / (3 · 4 + 4).
TEST(LeastSquares, WeighsItsEquations) {
  LeastSquares squares(2);
  squares.add({{0, 2}}, 6, 3);
  squares.add({{0, 1}}, 5, 4);
  squares.add({{0, 1}, {1, -2}}, 1, 1);
  EXPECT_DOUBLE_EQ(squares.trace(), 3 * 4 + 4 + 1 + 4);
  const Eigen::VectorXd found = squares.solve();
  EXPECT_NEAR(found[0], 3.5, 1e-12);
  EXPECT_NEAR(found[1], 1.25, 1e-12);
}

// Of five unknowns, those from the second to the fourth are knots.
TEST(LeastSquares, StraightensOnlyTheFunctionsOwnKnots) {
  LeastSquares squares(5);
  squares.add({{0, 1}}, 7, 1);
  squares.add({{1, 1}}, 2, 1);
  squares.add({{3, 1}}, 5, 1);
  squares.add({{4, 1}}, -9, 1);
  squares.straighten(1, 3, 10);
  const Eigen::VectorXd found = squares.solve();
  EXPECT_NEAR(found[0], 7, 1e-9);
  EXPECT_NEAR(found[1], 2, 1e-9);
  EXPECT_NEAR(found[2], 3.5, 1e-9);
  EXPECT_NEAR(found[3], 5, 1e-9);
  EXPECT_NEAR(found[4], -9, 1e-9);
}

// a + 2 b = 5 alone: the point of that line that is nearest to zero.
TEST(LeastSquares, TakesTheSmallestOfManySolutions) {
  LeastSquares squares(2);
  squares.add({{0, 1}, {1, 2}}, 5, 3);
  const Eigen::VectorXd found = squares.solve();
  EXPECT_NEAR(found[0], 1, 1e-9);
  EXPECT_NEAR(found[1], 2, 1e-9);
}

}  // namespace
}  // namespace dtact::calibration
