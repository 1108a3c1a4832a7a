#include "clients/calibrate/force/force_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <vector>

namespace dtact::force {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

double law(double v, double a) { return 0.12 * v + 0.005 * a + 0.002 * v * a; }

// Balls and plates: volume over area differs.
std::vector<Pair> pairs() {
  std::vector<Pair> pairs;
  for (const auto& [v, a] : {std::pair{0.3, 2.0},
                             {0.9, 3.5},
                             {1.7, 5.3},
                             {2.7, 6.9},
                             {3.9, 8.1},
                             {1.9, 13.0},
                             {3.3, 14.1},
                             {5.5, 15.3},
                             {7.6, 16.0},
                             {9.7, 16.6}}) {
    pairs.push_back({"load", v, a, law(v, a)});
  }
  return pairs;
}

TEST(FitForce, FindsTheLawBehindExactReadings) {
  const Fit fit = fit_force(pairs(), 0.1);
  EXPECT_NEAR(fit.model.per_mm3, 0.12, 1e-4);
  EXPECT_NEAR(fit.model.per_mm2, 0.005, 1e-4);
  EXPECT_NEAR(fit.model.per_mm5, 0.002, 1e-5);
  EXPECT_LT(fit.model.error_n, 1e-4);
  EXPECT_EQ(fit.model.threshold_mm, 0.1);
  EXPECT_EQ(fit.model.pairs, 10);
  EXPECT_NEAR(fit.model.from_n, law(0.3, 2.0), 1e-12);
  EXPECT_NEAR(fit.model.to_n, law(9.7, 16.6), 1e-12);
  EXPECT_NEAR(recon::force_of(fit.model, 5, 10).newtons, law(5, 10), 1e-3);
}

// What the short cut by leverage says is what a fit without the pair says.
TEST(FitForce, LeavesOutByRefitting) {
  std::vector<Pair> noisy = pairs();
  for (std::size_t i = 0; i < noisy.size(); ++i) noisy[i].newtons += i % 2 == 0 ? 0.03 : -0.02;
  const Fit fit = fit_force(noisy, 0.1);
  const auto x_of = [](const Pair& p) {
    return cv::Vec3d(p.volume_mm3, p.area_mm2, p.volume_mm3 * p.area_mm2);
  };
  cv::Vec3d squares;
  for (const Pair& pair : noisy) squares += x_of(pair).mul(x_of(pair));
  double sum = 0;
  for (std::size_t out = 0; out < noisy.size(); ++out) {
    cv::Matx33d normal = fit.ridge * cv::Matx33d::diag({squares[0], squares[1], squares[2]});
    cv::Vec3d right;
    for (std::size_t i = 0; i < noisy.size(); ++i) {
      if (i == out) continue;
      normal += x_of(noisy[i]) * x_of(noisy[i]).t();
      right += x_of(noisy[i]) * noisy[i].newtons;
    }
    const double error = x_of(noisy[out]).dot(normal.inv() * right) - noisy[out].newtons;
    EXPECT_NEAR(fit.left_out[out], error, 1e-6) << out;
    sum += std::abs(error);
  }
  EXPECT_NEAR(fit.model.error_n, sum / 10, 1e-6);
}

TEST(FitForce, IsLessSureBeyondItsReadings) {
  std::vector<Pair> noisy = pairs();
  noisy[3].newtons += 0.1;
  const recon::ForceModel model = fit_force(noisy, 0.1).model;
  const double near = recon::force_of(model, 3, 9).uncertainty_n;
  EXPECT_GT(near, model.error_n);
  EXPECT_LT(near, 1.5 * model.error_n);
  EXPECT_GT(recon::force_of(model, 40, 50).uncertainty_n, 3 * model.error_n);
}

TEST(FitForce, TellsNoPull) {
  const recon::ForceModel model{.per_mm3 = 1, .per_mm2 = -1};
  EXPECT_EQ(recon::force_of(model, 1, 2).newtons, 0);
}

void expect_refused(const std::vector<Pair>& pairs, const char* a, const char* b) {
  EXPECT_THAT([&] { (void)fit_force(pairs, 0.1); },
              ThrowsMessage<std::invalid_argument>(AllOf(HasSubstr(a), HasSubstr(b))));
}

TEST(FitForce, RefusesWhatCannotBeRight) {
  std::vector<Pair> few = pairs();
  few.resize(7);
  expect_refused(few, "7 pairs", "at least 8");

  std::vector<Pair> air = pairs();
  air[4] = {"press/4.png", 0, 0, 0.5};
  expect_refused(air, "press/4.png", "nothing touches");

  std::vector<Pair> zero = pairs();
  zero[2].newtons = 0;
  expect_refused(zero, "load", "not above 0");

  std::vector<Pair> swapped = pairs();
  for (std::size_t i = 0; i < 5; ++i) std::swap(swapped[i].newtons, swapped[9 - i].newtons);
  expect_refused(swapped, "do not grow with the pressed volume", "same order");

  std::vector<Pair> grams = pairs();
  for (Pair& pair : grams) pair.newtons *= 102;
  expect_refused(grams, "newtons", "--grams");

  std::vector<Pair> kilograms = pairs();
  for (Pair& pair : kilograms) pair.newtons /= 9.81;
  expect_refused(kilograms, "newtons", "1 kg weighs 9.81 N");
}

}  // namespace
}  // namespace dtact::force
