#include "clients/calibrate/force/force_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

namespace dtact::force {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr int kWidth = 500;
constexpr int kHeight = 400;
constexpr double kMmPerPx = 0.0417;
constexpr double kModulus = 0.13;
constexpr double kZero = 0.02;

/// The indentation map of a ball of 4 mm off the centre, `depth_mm` deep, as a cap.
recon::CellMap cap(double depth_mm) {
  std::vector<std::int16_t> um;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double r = kMmPerPx * std::hypot(x - 270, y - 180);
      const double mm = depth_mm - (4 - std::sqrt(std::max(0.0, 16 - r * r)));
      um.push_back(static_cast<std::int16_t>(std::lround(1000 * std::max(0.0, mm))));
    }
  }
  recon::CellMap cells(kWidth, kHeight, kMmPerPx);
  cells.read(um);
  return cells;
}

std::vector<Pair> pairs(double thickness_mm = 2.3) {
  std::vector<Pair> pairs;
  for (const double depth : {0.25, 0.4, 0.55, 0.7, 0.9, 1.1, 1.3, 1.5}) {
    Pair pair{"load", cap(depth), 0};
    const auto answer = recon::GelResponse(thickness_mm, pair.contact).answer(pair.contact);
    pair.newtons = kModulus * (answer.mm2 + kZero * answer.mm);
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

TEST(FitForce, FindsTheLawBehindExactReadings) {
  const Fit fit = fit_force(pairs(), 2.3);
  EXPECT_NEAR(fit.model.modulus_mpa, kModulus, 0.001);
  EXPECT_NEAR(fit.model.zero_mm, kZero, 0.002);
  EXPECT_EQ(fit.model.thickness_mm, 2.3);
  EXPECT_LT(fit.model.error_share, 0.005);
  EXPECT_EQ(fit.model.pairs, 8);
  EXPECT_EQ(fit.model.from_n, pairs().front().newtons);
  EXPECT_EQ(fit.model.to_n, pairs().back().newtons);
}

TEST(FitForce, FindsTheThickness) {
  EXPECT_NEAR(fit_force(pairs(1.6)).model.thickness_mm, 1.6, 0.25);
  const Fit thick = fit_force(pairs(2.8));
  EXPECT_NEAR(thick.model.thickness_mm, 2.8, 0.4);
  EXPECT_LT(thick.model.error_share, 0.02);
}

TEST(FitForce, LeavesOutByRefitting) {
  std::vector<Pair> noisy = pairs();
  for (std::size_t i = 0; i < noisy.size(); ++i) noisy[i].newtons *= i % 2 == 0 ? 1.06 : 0.97;
  const Fit fit = fit_force(noisy, 2.3);
  std::vector<Pair> others = noisy;
  others.erase(others.begin() + 5);
  const recon::ForceModel model = fit_force(others, 2.3).model;
  const auto answer = recon::GelResponse(2.3, noisy[5].contact).answer(noisy[5].contact);
  EXPECT_NEAR(fit.left_out[5], recon::force_of(model, answer, 0).newtons - noisy[5].newtons, 1e-6);
  EXPECT_GT(fit.model.error_share, 0.02);
  EXPECT_LT(fit.model.error_share, 0.1);
}

void expect_refused(const std::vector<Pair>& pairs, const char* a, const char* b) {
  EXPECT_THAT([&] { (void)fit_force(pairs, 2.3); },
              ThrowsMessage<std::invalid_argument>(AllOf(HasSubstr(a), HasSubstr(b))));
}

TEST(FitForce, RefusesWhatCannotBeRight) {
  std::vector<Pair> few = pairs();
  few.erase(few.begin() + 5, few.end());
  expect_refused(few, "5 pairs", "at least 6");

  std::vector<Pair> air = pairs();
  air[4] = {"press/4.png", cap(0), 0.5};
  expect_refused(air, "press/4.png", "no contact");

  std::vector<Pair> other = pairs();
  other[4] = {"quarter.mcap", recon::CellMap(kWidth / 4, kHeight / 4, 4.1 * kMmPerPx), 0.5};
  expect_refused(other, "quarter.mcap", "one resolution");

  std::vector<Pair> edge = pairs();
  std::vector<std::int16_t> all(std::size_t{kWidth} * kHeight, 500);
  edge[4].contact.read(all);
  expect_refused(edge, "edge", "nearer to the middle");

  std::vector<Pair> zero = pairs();
  zero[2].newtons = 0;
  expect_refused(zero, "load", "not above 0");

  std::vector<Pair> swapped = pairs();
  for (std::size_t i = 0; i < 4; ++i) std::swap(swapped[i].newtons, swapped[7 - i].newtons);
  expect_refused(swapped, "missed by", "same order");

  std::vector<Pair> grams = pairs();
  for (Pair& pair : grams) pair.newtons *= 102;
  expect_refused(grams, "newtons", "--grams");

  std::vector<Pair> kilograms = pairs();
  for (Pair& pair : kilograms) pair.newtons /= 9.81;
  expect_refused(kilograms, "newtons", "1 kg weighs 9.81 N");
}

// Exact readings of a gel with this modulus, whose depth has its zero in place.
std::vector<Pair> pairs_of_modulus(double modulus_mpa) {
  std::vector<Pair> made = pairs();
  for (Pair& pair : made) {
    pair.newtons = modulus_mpa * recon::GelResponse(2.3, pair.contact).answer(pair.contact).mm2;
  }
  return made;
}

TEST(FitForce, TheModuliOfSiliconesAreAllowed) {
  for (const double modulus_mpa : {0.0201, 1.99}) {
    EXPECT_NEAR(fit_force(pairs_of_modulus(modulus_mpa), 2.3).model.modulus_mpa, modulus_mpa,
                1e-3 * modulus_mpa);
  }
  expect_refused(pairs_of_modulus(0.0199), "0.0199 MPa", "1 kg weighs 9.81 N");
  expect_refused(pairs_of_modulus(2.01), "2.01 MPa", "--grams takes grams");
}

}  // namespace
}  // namespace dtact::force
