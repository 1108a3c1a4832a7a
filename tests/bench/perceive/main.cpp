// Time of dtact-perceive's work: points and normals of a whole map and of a contact's box, and
// the motion of the object in contact, on each surface, as a Markdown table, and the goals.
//
//   bench_perceive [RUNS]
//
// A thing of four balls slides over the map, whose points and motion are known: what is timed is
// compared with that first, and 1 is returned when it is wrong. CPU time of the one thread; the
// surfaces take turns, medians and quartiles over RUNS (50 when left out).
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/geometry/point_cloud.hpp"
#include "clients/perceive/pose/tracker.hpp"
#include "tests/bench/cpu_time.hpp"
#include "tests/unit/perceive/balls.hpp"

namespace dtact::perceive {
namespace {

using Eigen::Vector3d;
using Kind = recon::Surface::Kind;

constexpr int kSide = 580;
constexpr double kMmPerPx = 0.0413793;
constexpr double kNoisyMapGoalMs = 1;  // of a plane
constexpr double kMapGoalMs = 0.3;
constexpr double kPoseGoalMs = 5;  // 200 a second
/// Frames in which the object slides by kSlideMm.
constexpr int kFrames = 20;
constexpr double kSlideMm = 1;

struct Sensor {
  const char* name;
  recon::Surface surface;
  std::vector<SurfacePoint> pixels;
};

Sensor sensor(const char* name, const recon::Surface& surface) {
  Sensor made{name, surface, {}};
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      made.pixels.push_back(cast_ray(surface, (column - 0.5 * (kSide - 1)) * kMmPerPx,
                                     (row - 0.5 * (kSide - 1)) * kMmPerPx)
                                .value());
    }
  }
  return made;
}

/// Whole micrometres of the object after a slide, with 3 µm of noise: everywhere, or, like in the
/// daemon, 0 where nothing changes.
enum class Noise : std::uint8_t { everywhere, in_contact };
std::vector<std::int16_t> map_of(const Sensor& sensor, double slide_mm,
                                 Noise where = Noise::everywhere) {
  const test::Balls object = test::bumps();
  const Motion motion = test::moved({slide_mm, 0, 0});
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 3);
  std::vector<std::int16_t> map;
  map.reserve(sensor.pixels.size());
  for (const SurfacePoint& pixel : sensor.pixels) {
    const double depth = test::indentation_mm(object, motion, pixel);
    const bool still = where == Noise::in_contact && depth == 0;
    map.push_back(static_cast<std::int16_t>(still ? 0 : std::lround(1000 * depth + noise(random))));
  }
  return map;
}

/// The part of a map that begins at (x, y).
struct Part {
  Part(const std::vector<std::int16_t>& map, int x, int y, int width, int height) {
    for (int row = y; row < y + height; ++row) {
      const auto* from = map.data() + std::ptrdiff_t{row} * kSide + x;
      values.insert(values.end(), from, from + width);
    }
    grid = {x, y, width, height, kSide, kSide, kMmPerPx, 1, -32768, values};
  }
  std::vector<std::int16_t> values;
  DepthGrid grid;
};

struct Times {
  std::vector<double> ms;

  [[nodiscard]] double part(double share) {
    std::sort(ms.begin(), ms.end());
    return ms[static_cast<std::size_t>(share * static_cast<double>(ms.size() - 1))];
  }
};

/// Compares every point with the surface point moved along its ray, to a tenth of a micrometre.
void verify(const Sensor& sensor, const Part& part, const PointCloud& cloud) {
  for (int row = 0; row < cloud.height; ++row) {
    for (int column = 0; column < cloud.width; ++column) {
      const auto i = static_cast<std::size_t>(row * cloud.width + column);
      const SurfacePoint& pixel =
          sensor
              .pixels[static_cast<std::size_t>((part.grid.y + row) * kSide + part.grid.x + column)];
      const Vector3d there =
          Vector3d(pixel.point.data()) - 1e-6 * part.values[i] * Vector3d(pixel.ray.data());
      const Vector3d point(cloud.part(PointCloud::kX)[i], cloud.part(PointCloud::kY)[i],
                           cloud.part(PointCloud::kZ)[i]);
      const Vector3d normal(cloud.part(PointCloud::kNormalX)[i],
                            cloud.part(PointCloud::kNormalY)[i],
                            cloud.part(PointCloud::kNormalZ)[i]);
      if (!((point - there).norm() < 1e-7) || !(std::abs(normal.norm() - 1) < 1e-4)) {
        throw std::runtime_error(
            fmt::format("{}: the point of row {}, column {} is wrong", sensor.name, row, column));
      }
    }
  }
}

struct Measured {
  Times map;
  Times changed;
  Times box;
  Times pose;
};

/// Frames of one sensor.
struct Frames {
  Part noisy;
  std::vector<Part> whole;
  std::vector<Part> box;
};

void measure(const Sensor& sensor, const Frames& of, CloudMaker& maker, Measured& measured) {
  const std::vector<Part>& frames = of.box;
  PointCloud cloud;
  maker.make(of.noisy.grid, 1, cloud);
  verify(sensor, of.noisy, cloud);
  measured.map.ms.push_back(bench::cpu_ms([&] { maker.make(of.noisy.grid, 1, cloud); }));
  maker.make(of.whole.back().grid, 1, cloud);
  for (const Part& whole : of.whole) {
    measured.changed.ms.push_back(bench::cpu_ms([&] { maker.make(whole.grid, 1, cloud); }));
  }
  verify(sensor, of.whole.back(), cloud);
  Tracker tracker;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    PointCloud contact;
    maker.make(frames[i].grid, 1, contact);
    measured.box.ms.push_back(bench::cpu_ms([&] { maker.make(frames[i].grid, 1, contact); }));
    const double ms = bench::cpu_ms(
        [&] { (void)tracker.follow(ContactView(frames[i].grid, contact, maker.table(), 10), i); });
    if (i > 0) measured.pose.ms.push_back(ms + measured.box.ms.back());
  }
  const Motion& motion = tracker.pose().alignment.motion;
  const double off_mm = (1e3 * motion.translation() - Vector3d(kSlideMm, 0, 0)).norm();
  if (tracker.pose().state != Tracker::State::tracked || !(off_mm < 0.03)) {
    throw std::runtime_error(fmt::format("{}: the slide is {:.3f} mm off", sensor.name, off_mm));
  }
}

int run(int runs) {
  const recon::Surface sphere{Kind::sphere, 30, 0, 20, 8, 1.41};
  const std::array sensors{sensor("plane", {}), sensor("sphere", sphere),
                           sensor("cylinder", {Kind::cylinder, 30, 30, 20, 8, 1.41})};
  std::vector<Frames> frames;
  std::vector<CloudMaker> makers;
  for (const Sensor& one : sensors) {
    frames.push_back({{map_of(one, 0), 0, 0, kSide, kSide}, {}, {}});
    for (int i = 0; i <= kFrames; ++i) {
      const double slide_mm = kSlideMm * i / kFrames;
      frames.back().box.emplace_back(map_of(one, slide_mm), 190, 210, 220, 170);
      if (i % 5 != 0) continue;
      frames.back().whole.emplace_back(map_of(one, slide_mm, Noise::in_contact), 0, 0, kSide,
                                       kSide);
    }
    makers.emplace_back(one.surface);
  }
  std::array<Measured, sensors.size()> measured;
  for (int i = 0; i < runs; ++i) {
    for (std::size_t k = 0; k < sensors.size(); ++k) {
      measure(sensors[k], frames[k], makers[k], measured[k]);
    }
  }
  const auto cell = [](Times& times) {
    return fmt::format("{:.3f} ({:.3f}–{:.3f})", times.part(0.5), times.part(0.25),
                       times.part(0.75));
  };
  fmt::print(
      "| ms, one core | points of {0}×{0}, noise everywhere | noise in the contact | of 220×170 | "
      "motion, points included |\n",
      kSide);
  fmt::print("| --- | --- | --- | --- | --- |\n");
  std::string goals;
  for (std::size_t k = 0; k < sensors.size(); ++k) {
    Measured& one = measured[k];
    fmt::print("| {} | {} | {} | {} | {} |\n", sensors[k].name, cell(one.map), cell(one.changed),
               cell(one.box), cell(one.pose));
    const auto goal = [&](const char* what, double is, double wanted) {
      goals += fmt::format("{}  {}, {}: {:.3f} ms, goal {}\n", is <= wanted ? "met  " : "SHORT",
                           sensors[k].name, what, is, wanted);
    };
    if (k == 0) {
      goal("points of a whole map, noise everywhere", one.map.part(0.5), kNoisyMapGoalMs);
    }
    goal("of one with noise in the contact", one.changed.part(0.5), kMapGoalMs);
    goal("motion", one.pose.part(0.5), kPoseGoalMs);
  }
  fmt::print("\n{}", goals);
  return 0;
}

}  // namespace
}  // namespace dtact::perceive

int main(int argc, char** argv) {
  try {
    const int runs = argc > 1 ? std::atoi(argv[1]) : 50;
    if (runs < 1) throw std::invalid_argument("RUNS is a whole number above 0");
    return dtact::perceive::run(runs);
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_perceive: {}\n", e.what());
    return 1;
  }
}
