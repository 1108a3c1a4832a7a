#include "tests/accuracy/table/trial.hpp"

#include <cmath>
#include <random>

namespace dtact::table {
namespace {

constexpr double kCentreReach = 1.0;
constexpr double kReach = 8.0;
constexpr double kPeriod = 2.0;  // seconds from one press to the next

// std::uniform_real_distribution differs between libraries.
double between(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11U) * 0x1p-53;
}

BallPress anywhere(std::mt19937_64& random, double radius, double shallow, double deep,
                   double reach) {
  const double x = between(random, -reach, reach);
  const double y = between(random, -reach, reach);
  return {radius, x, y, between(random, shallow, deep)};
}

double begin_s(std::size_t index) { return 1 + kPeriod * static_cast<double>(index); }

}  // namespace

std::vector<BallPress> Trial::all() const {
  std::vector<BallPress> presses = {centre};
  presses.insert(presses.end(), many.begin(), many.end());
  presses.insert(presses.end(), tests.begin(), tests.end());
  return presses;
}

Trial draw(std::uint64_t seed, const Protocol& protocol) {
  std::mt19937_64 random(seed);
  Trial trial;
  trial.seed = seed;
  trial.centre = anywhere(random, protocol.calibration_radius_mm, 1.3, 1.6, kCentreReach);
  for (int i = 0; i < protocol.calibration_presses; ++i) {
    trial.many.push_back(anywhere(random, protocol.calibration_radius_mm, 0.3, 1.2, kReach));
  }
  for (int i = 0; i < protocol.test_presses; ++i) {
    trial.tests.push_back(anywhere(random, protocol.test_radius_mm, 0.4, 1.4, kReach));
  }
  return trial;
}

std::shared_ptr<const hal::sim::Truth> solve(const hal::sim::Scene& base,
                                             const std::vector<BallPress>& presses) {
  hal::sim::Scene scene = base;
  scene.gel.solve_step_mm = 5;  // only presses at rest are judged
  scene.loop_from_s = scene.loop_to_s = 0;
  scene.presses.clear();
  scene.faults.clear();
  for (std::size_t i = 0; i < presses.size(); ++i) {
    const BallPress& press = presses[i];
    const double t = begin_s(i);
    const auto key = [&](double after, double depth) {
      return hal::sim::PressKey{t + after, press.x_mm, press.y_mm, depth, 0};
    };
    scene.presses.push_back(
        {hal::sim::ball(press.radius_mm),
         {key(0, 0), key(0.1, press.depth_mm), key(0.9, press.depth_mm), key(1, 0)}});
  }
  return std::make_shared<const hal::sim::Truth>(scene);
}

std::uint64_t first_still_frame(const hal::sim::Truth& truth, std::size_t index) {
  return static_cast<std::uint64_t>(
      std::lround((begin_s(index) + 0.15) * truth.scene().camera.fps));
}

}  // namespace dtact::table
