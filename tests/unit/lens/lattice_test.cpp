#include "clients/calibrate/lens/lattice.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace dtact::ctl {
namespace {

constexpr int kRows = 5;
constexpr int kCols = 7;

/// A lattice of 40 pixels whose steps grow by 2 % from column to column and that leans.
cv::Point2d node(int row, int col) {
  return {60 + 40 * (std::pow(1.02, col) - 1) / 0.02 + 4.0 * row, 50 + 40.0 * row - 3.0 * col};
}

std::vector<Candidate> lattice() {
  std::vector<Candidate> candidates;
  for (int row = 0; row < kRows; ++row) {
    for (int col = 0; col < kCols; ++col) candidates.push_back({node(row, col), 3.0});
  }
  return candidates;
}

const Lattice* whole(const std::vector<Lattice>& lattices) {
  for (const Lattice& found : lattices) {
    if (found.found == kRows * kCols) return &found;
  }
  return nullptr;
}

void expect_in_place(const Lattice& found) {
  for (int row = 0; row < kRows; ++row) {
    for (int col = 0; col < kCols; ++col) {
      const auto& place = found.places[static_cast<std::size_t>(row * kCols + col)];
      ASSERT_TRUE(place.has_value());
      EXPECT_EQ(*place, node(row, col));
    }
  }
}

TEST(Lattice, IsFollowedWhereItsStepsGrow) {
  const auto lattices = find_lattices(lattice(), kRows, kCols);
  ASSERT_NE(whole(lattices), nullptr);
  expect_in_place(*whole(lattices));
}

TEST(Lattice, IsFoundAmongOtherCandidates) {
  std::vector<Candidate> candidates = lattice();
  for (int i = 0; i < 30; ++i) {  // between the nodes and beyond them
    candidates.push_back({{37.0 + 97 * i % 330, 24.0 + 61 * i % 240}, 2.0});
  }
  const auto lattices = find_lattices(candidates, kRows, kCols);
  ASSERT_NE(whole(lattices), nullptr);
  expect_in_place(*whole(lattices));
}

TEST(Lattice, LeavesMissingNodesEmpty) {
  std::vector<Candidate> candidates = lattice();
  candidates.erase(candidates.begin() + 2 * kCols + 3);
  const auto lattices = find_lattices(candidates, kRows, kCols);
  ASSERT_FALSE(lattices.empty());
  EXPECT_EQ(lattices.front().found, kRows * kCols - 1);
  EXPECT_FALSE(lattices.front().places[2 * kCols + 3].has_value());
}

TEST(Lattice, IsNotSeenInAFewCandidates) {
  EXPECT_TRUE(find_lattices({}, kRows, kCols).empty());
  EXPECT_TRUE(find_lattices({{{10, 10}, 1.0}, {{50, 10}, 1.0}}, kRows, kCols).empty());
}

TEST(Candidates, AreTheBlobsOfTheirSize) {
  cv::Mat1f image(100, 140, 0.F);
  for (const cv::Point blob : {cv::Point(40, 30), cv::Point(100, 70)}) {
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        image(y, x) += 10 * std::exp(-static_cast<float>((x - blob.x) * (x - blob.x) +
                                                         (y - blob.y) * (y - blob.y)) /
                                     50);
      }
    }
  }
  const auto candidates = find_candidates(image, 5);
  ASSERT_GE(candidates.size(), 2U);
  const auto near = [&](cv::Point2d at) {
    return cv::norm(candidates[0].px - at) < 1 || cv::norm(candidates[1].px - at) < 1;
  };
  EXPECT_TRUE(near({40, 30}));
  EXPECT_TRUE(near({100, 70}));
}

// Also where the size is a single pixel: next to a maximum there is no other.
TEST(Candidates, APointIsOneOfAnySize) {
  for (const double sigma : {1.0, 1.9, 2.4, 5.0}) {
    cv::Mat1f image(70, 110, 0.F);
    image(31, 47) = 100;
    const auto candidates = find_candidates(image, sigma);
    ASSERT_EQ(candidates.size(), 1U) << sigma;
    EXPECT_EQ(candidates[0].px, cv::Point2d(47, 31)) << sigma;
  }
}

}  // namespace
}  // namespace dtact::ctl
