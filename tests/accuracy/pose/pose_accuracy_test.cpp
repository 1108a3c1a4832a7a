// The motion of objects that slide by 4 mm, twist by 30° or are pressed deeper, as the tracker
// finds it on the layer's true indentation with noise, in whole micrometres: what the mechanics of
// a soft layer do to a shape, without the errors of a calibration. Against where the scene puts the
// object; only in the directions that the tracker says it sees.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <random>

#include "hal/sim/scene.hpp"
#include "hal/sim/truth.hpp"
#include "tests/unit/perceive/balls.hpp"

namespace dtact::perceive {
namespace {

using test::Error;

constexpr int kSide = 580;
constexpr int kColumn = 110;  ///< Of the depth map in the image of 800 × 600.
constexpr int kRow = 10;
constexpr double kMmPerPx = 0.0413793;
constexpr double kNoiseUm = 3;
constexpr double kStartDeg = 10;
constexpr double kYMm = 0.3;

struct Way {
  const char* name;
  double slide_mm = 0;
  double twist_deg = 0;
  double deeper_mm = 0;
};

std::string scene_of(const std::string& object, const Way& way) {
  return fmt::format(
      "[[press]]\n{}\nkeys = [\n  {{ t = 0.0, x = {}, y = {}, depth = 0.5, rotation = {} }},\n"
      "  {{ t = 2.0, x = {}, y = {}, depth = {}, rotation = {} }},\n]\n",
      object, -way.slide_mm / 2, kYMm, kStartDeg, way.slide_mm / 2, kYMm, 0.5 + way.deeper_mm,
      kStartDeg + way.twist_deg);
}

/// Where the object's points of the first frame are after `part` of the way.
Motion truth_of(const Way& way, double part) {
  const Motion turn = test::moved({0, 0, 0}, Eigen::Vector3d::UnitZ(), part * way.twist_deg);
  const Eigen::Vector3d from(-way.slide_mm / 2 * 1e-3, kYMm * 1e-3, 0);
  const Eigen::Vector3d to =
      from + Eigen::Vector3d(part * way.slide_mm, 0, -part * way.deeper_mm) * 1e-3;
  return {turn.rotation, to - turn.rotation * from};
}

/// A frame's map around what is pressed.
struct Map {
  Map(const std::vector<float>& truth_mm, std::mt19937& random) {
    std::normal_distribution<double> normal(0, kNoiseUm);
    int right = -1;
    int bottom = -1;
    grid.x = kSide;
    grid.y = kSide;
    std::vector<std::int16_t> all;
    for (int row = 0; row < kSide; ++row) {
      for (int column = 0; column < kSide; ++column) {
        const auto at = static_cast<std::size_t>((row + kRow) * 800 + column + kColumn);
        all.push_back(static_cast<std::int16_t>(
            std::lround(1000 * static_cast<double>(truth_mm[at]) + normal(random))));
        if (all.back() <= 100) continue;
        grid.x = std::min(grid.x, std::max(0, column - 16));
        grid.y = std::min(grid.y, std::max(0, row - 16));
        right = std::max(right, std::min(kSide - 1, column + 16));
        bottom = std::max(bottom, std::min(kSide - 1, row + 16));
      }
    }
    grid.width = right - grid.x + 1;
    grid.height = bottom - grid.y + 1;
    grid.full_width = grid.full_height = kSide;
    grid.mm_per_px = kMmPerPx;
    for (int row = grid.y; row <= bottom; ++row) {
      const auto* from = all.data() + std::ptrdiff_t{row} * kSide + grid.x;
      values.insert(values.end(), from, from + grid.width);
    }
    grid.values = values;
  }
  std::vector<std::int16_t> values;
  DepthGrid grid;
};

double cpu_us() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) * 1e-3;
}

struct Result {
  Error last;
  Error worst;
  int lost = 0;
  std::size_t hidden = 0;
};

Result follow(const std::string& object, const Way& way) {
  hal::sim::Scene scene = hal::sim::parse_scene(scene_of(object, way), way.name);
  scene.layer.solve_step_mm = 0.2;
  const hal::sim::Truth truth(scene);
  Tracker tracker;
  CloudMaker maker;
  PointCloud cloud;
  std::mt19937 random(1);
  std::vector<float> mm;
  std::vector<double> times;
  Result result;
  constexpr std::uint64_t kEnd = 120;  // two seconds
  for (std::uint64_t sequence = 0; sequence <= kEnd; sequence += 5) {
    truth.indentation_mm(sequence, mm);
    const Map map(mm, random);
    const double before = cpu_us();
    maker.make(map.grid, 1, cloud);
    const auto& pose = tracker.follow(ContactView(map.grid, cloud, 10), sequence);
    times.push_back(cpu_us() - before);
    if (pose.state == Tracker::State::lost) {
      ++result.lost;
      continue;
    }
    const double part = static_cast<double>(sequence) / kEnd;
    result.last = test::error_of(pose.alignment, truth_of(way, part));
    result.worst.um = std::max(result.worst.um, result.last.um);
    result.worst.degrees = std::max(result.worst.degrees, result.last.degrees);
    result.hidden = pose.alignment.unobservable.size();
  }
  std::sort(times.begin(), times.end());
  std::printf(
      "%-40s %-7s %zu hidden: at the end %5.1f um %5.2f deg, worst %5.1f um %5.2f deg; %4.0f us\n",
      object.substr(0, 40).c_str(), way.name, result.hidden, result.last.um, result.last.degrees,
      result.worst.um, result.worst.degrees, times[times.size() / 2]);
  return result;
}

constexpr Way kSlide{"slide", 4, 0, 0};
constexpr Way kTwist{"twist", 0, 30, 0};
constexpr Way kDeeper{"deeper", 0, 0, 0.3};

void expect_found(const std::string& object, const Way& way, std::size_t most_hidden) {
  const Result result = follow(object, way);
  EXPECT_EQ(result.lost, 0);
  EXPECT_LT(result.worst.um, 80);
  EXPECT_LT(result.worst.degrees, 1.0);
  EXPECT_LE(result.hidden, most_hidden);
}

TEST(PoseOnTheSimulatedLayer, M4Nut) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) expect_found("object = \"m4_nut\"", way, 1);
}

TEST(PoseOnTheSimulatedLayer, Cube) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) {
    expect_found("object = \"cube\"\nside_mm = 5.0", way, 0);
  }
}

TEST(PoseOnTheSimulatedLayer, ABallShowsThreeDirections) {
  for (const Way& way : {kSlide, kTwist, kDeeper}) {
    expect_found("object = \"ball\"\nradius_mm = 4.0", way, 3);
  }
}

}  // namespace
}  // namespace dtact::perceive
