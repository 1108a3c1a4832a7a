#include "tests/accuracy/study/bench.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "hal/sim/renderer.hpp"

namespace dtact::study {
namespace {

constexpr double kFps = 10;
constexpr std::uint64_t kSeed = 1;
constexpr std::uint64_t kReferenceFrames = 4;
constexpr double kSpeed = 0.1;  // mm/s of a press, from one second on

hal::sim::Scene seen_by_its_camera(hal::sim::Scene sensor) {
  sensor.camera.width = kWidth;
  sensor.camera.height = kHeight;
  sensor.camera.mm_per_px = kMmPerPx;
  sensor.camera.fps = kFps;
  // Half a pillar's radius is 2.5 grid points; halving the spacing changes a dip by 0.02.
  sensor.gel.grid_mm = 0.1;
  sensor.gel.solve_step_mm = 5;
  sensor.loop_from_s = sensor.loop_to_s = 0;
  sensor.faults.clear();
  return sensor;
}

double time_s(double depth_mm) { return 1 + depth_mm / kSpeed; }

double slope(double degrees) { return std::tan(degrees * std::numbers::pi / 180); }

// Means of shrink × shrink pixels, in sums of `count` frames, rounded to grey levels.
std::vector<int> shrunk(const std::vector<std::uint32_t>& sums, int count, int shrink) {
  const int width = kWidth / shrink;
  const int height = kHeight / shrink;
  std::vector<int> out;
  out.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const std::uint32_t n = static_cast<std::uint32_t>(shrink * shrink * count);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::uint32_t sum = 0;
      for (int row = y * shrink; row < (y + 1) * shrink; ++row) {
        const auto first = static_cast<std::size_t>(row) * kWidth;
        for (int column = x * shrink; column < (x + 1) * shrink; ++column) {
          sum += sums[first + static_cast<std::size_t>(column)];
        }
      }
      out.push_back(static_cast<int>((sum + n / 2) / n));
    }
  }
  return out;
}

}  // namespace

hal::sim::Object askew(const hal::sim::Object& object, double degrees) {
  const double rise = slope(degrees);
  return {object.kind, object.reach_mm, [object, rise](double x, double y) {
            return object.height_mm(x, y) + rise * (object.reach_mm - x);
          }};
}

double lowest_of_askew(const hal::sim::Object& object, double degrees) {
  return slope(degrees) * object.reach_mm;
}

std::shared_ptr<const hal::sim::Truth> press(const hal::sim::Scene& sensor, const Ladder& ladder) {
  hal::sim::Scene scene = seen_by_its_camera(sensor);
  hal::sim::Press press{ladder.object, {{.time_s = time_s(0)}}};
  for (const double depth : ladder.depths_mm) {
    // Between two solved depths the simulator is linear.
    if (ladder.proportional && depth != ladder.depths_mm.back()) continue;
    press.keys.push_back({.time_s = time_s(depth), .depth_mm = depth + ladder.deeper_mm});
  }
  scene.presses = {press};
  return std::make_shared<const hal::sim::Truth>(scene);
}

std::vector<Darkening> photograph(const std::shared_ptr<const hal::sim::Truth>& truth,
                                  const hal::sim::Scene& sensor, std::span<const double> depths_mm,
                                  int shrink) {
  const hal::sim::LedLevels light = hal::sim::led_levels({});
  hal::sim::Renderer renderer(truth, seen_by_its_camera(sensor), kSeed);
  std::vector<std::uint8_t> luma(std::size_t{kWidth} * kHeight);
  std::vector<std::uint32_t> sums(luma.size());
  const auto add = [&](std::uint64_t sequence) {
    renderer.render(sequence, light, luma.data(), kWidth, kHeight);
    std::ranges::transform(sums, luma, sums.begin(),
                           [](std::uint32_t sum, std::uint8_t v) { return sum + v; });
  };
  for (std::uint64_t n = 0; n < kReferenceFrames; ++n) add(n);
  const std::vector<int> reference = shrunk(sums, kReferenceFrames, shrink);

  std::vector<Darkening> frames;
  for (const double depth : depths_mm) {
    std::ranges::fill(sums, 0U);
    add(static_cast<std::uint64_t>(std::lround(time_s(depth) * kFps)));
    const std::vector<int> frame = shrunk(sums, 1, shrink);
    Darkening darkening{kWidth / shrink, kHeight / shrink, kMmPerPx * shrink, {}};
    darkening.levels.reserve(frame.size());
    for (std::size_t p = 0; p < frame.size(); ++p) {
      darkening.levels.push_back(static_cast<std::uint8_t>(std::max(reference[p] - frame[p], 0)));
    }
    frames.push_back(std::move(darkening));
  }
  return frames;
}

}  // namespace dtact::study
