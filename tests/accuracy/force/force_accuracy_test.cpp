// The normal force that a client gets, calibrated as a user would with the simulated sensor, a ball
// and a kitchen scale. It is compared with the force of the simulator's own solution, on objects
// that were not used to calibrate. Frames pass camera, capture loop and frame encoder. No constant
// was chosen with this seed.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/accuracy/force/held_out.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::force {
namespace {

constexpr std::uint64_t kSeed = 20431;

TEST(ForceAccuracy, TheStatedErrorHolds) {
  std::vector<double> ratios;
  std::vector<double> shares;
  int presses = 0;
  for (const double thickness : {1.5, 2.0, 3.0}) {
    const calibration::TempFolder folder;
    const Trial trial = try_held_out(thickness, Calibrating::ball, kSeed, 16, folder.path());
    fmt::print("gel of {} mm: {}\n", thickness, trial.calibration);
    for (const HeldOut& press : trial.presses) {
      ++presses;
      EXPECT_EQ(press.valid, press.absence == v1::FORCE_ABSENCE_NONE);
      if (!press.valid) continue;
      ratios.push_back(ratio(press));
      if (press.in_contact) shares.push_back(ratio(press) * press.uncertainty_n / press.true_n);
    }
  }
  fmt::print(
      "error over stated: {:.2f} at the median, {:.2f} at 95 %; over the force: {:.3f}, {:.3f}\n",
      quantile(ratios, 0.5), quantile(ratios, 0.95), quantile(shares, 0.5), quantile(shares, 0.95));
  EXPECT_GT(4 * ratios.size(), 3U * static_cast<unsigned>(presses));
  EXPECT_LE(quantile(ratios, 0.5), 1);
  EXPECT_LE(quantile(ratios, 0.95), 2);
  EXPECT_LE(quantile(shares, 0.5), 0.08);
}

}  // namespace
}  // namespace dtact::force
