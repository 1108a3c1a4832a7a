// Objects that move on the simulated layer, what is true of them, and how the tracker and
// NormalFlow's method follow them: a folder of arrays for each, which comparison.py reads.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <cmath>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <vector>

#include "clients/perceive/pose/tracker.hpp"
#include "tests/accuracy/pose/normal_flow.hpp"
#include "tests/accuracy/pose/sequence.hpp"
#include "tests/accuracy/pose/things.hpp"
#include "tests/bench/cpu_time.hpp"

namespace dtact::pose {
namespace {

using perceive::Alignment;
using perceive::ContactView;
using perceive::Motion;
using perceive::PointCloud;
using perceive::Tracker;

/// Of what the daemon says of a depth without a calibration's own figure.
constexpr double kUncertaintyUm = 10;
/// Of 60 frames a second, the minute's of 15.
constexpr int kEvery = 2;
constexpr int kEveryOfAMinute = 4;
/// Points that are handed out, along both sides.
constexpr int kStride = 2;

/// A NumPy file, format 1.0, of rows of equal length; none where `width` is 0.
template <class T>
void save(const std::filesystem::path& file, const std::vector<T>& values, std::size_t width) {
  std::string header =
      fmt::format("{{'descr': '<f{}', 'fortran_order': False, 'shape': ({}, {}), }}", sizeof(T),
                  width == 0 ? 0 : values.size() / width, width);
  constexpr std::size_t kBefore = 10;
  header.resize((header.size() + kBefore + 64) / 64 * 64 - kBefore, ' ');
  header.back() = '\n';
  std::ofstream out(file, std::ios::binary);
  out << "\x93NUMPY\x01" << '\0' << static_cast<char>(header.size() % 256)
      << static_cast<char>(header.size() / 256) << header;
  out.write(reinterpret_cast<const char*>(values.data()),
            static_cast<std::streamsize>(values.size() * sizeof(T)));
  if (!out.flush()) throw std::runtime_error(fmt::format("cannot write {}", file.string()));
}

void append(std::vector<double>& row, const Motion& motion) {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) row.push_back(motion.rotation(i, k));
  }
  for (int i = 0; i < 3; ++i) row.push_back(motion.translation[i]);
}

/// About which point, with which arm, and which twists are not seen: six of them, NaN where there
/// are fewer.
void append_seen(std::vector<double>& row, const Alignment& seen) {
  for (int i = 0; i < 3; ++i) row.push_back(seen.centre[i]);
  row.push_back(seen.arm);
  for (std::size_t twist = 0; twist < 6; ++twist) {
    for (int i = 0; i < 6; ++i) {
      row.push_back(twist < seen.unobservable.size() ? seen.unobservable[twist][i]
                                                     : std::numeric_limits<double>::quiet_NaN());
    }
  }
}

std::vector<float> points_of(const PointCloud& cloud, const ContactView& view) {
  std::vector<float> rows;
  for (int row = 0; row < cloud.height; row += kStride) {
    for (int column = 0; column < cloud.width; column += kStride) {
      const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(cloud.width) +
                     static_cast<std::size_t>(column);
      const auto part = [&](PointCloud::Part which) { return cloud.part(which)[i]; };
      if (!cloud.has(i) ||
          !view.at({part(PointCloud::kX), part(PointCloud::kY), part(PointCloud::kZ)})) {
        continue;
      }
      for (int which = 0; which < PointCloud::kParts; ++which) {
        rows.push_back(part(static_cast<PointCloud::Part>(which)));
      }
    }
  }
  return rows;
}

/// `steps` of `every` frames each. NormalFlow's method knows a plane alone.
void follow(const std::string& object, const std::string& keys, int steps, int every,
            const std::filesystem::path& folder, const recon::Surface& surface = {}) {
  std::filesystem::create_directories(folder);
  Sequence frames(object, keys, surface);
  Tracker tracker;
  NormalFlow flow;
  perceive::CloudMaker maker(surface);
  PointCloud cloud;
  std::vector<double> truth;  // 12 of the motion, 40 of what is seen
  std::vector<double> ours;   // 12 of the motion, lost, microseconds
  std::vector<double> flows;
  for (int step = 0; step <= steps; ++step) {
    const auto sequence = static_cast<std::uint64_t>(step) * static_cast<std::uint64_t>(every);
    const Map clean = frames.map(sequence, 0);
    if (clean.values.empty()) break;  // what rolls on a finger may leave it
    maker.make(clean.grid, 1, cloud);
    append(truth, frames.motion(sequence));
    const ContactView clear(clean.grid, cloud, maker.table(), kUncertaintyUm);
    const auto surfels = clear.choose(600);
    append_seen(truth, perceive::align(surfels, clear, {}));

    const Map map = frames.map(sequence);
    const double before = bench::thread_us();
    maker.make(map.grid, 1, cloud);
    const ContactView view(map.grid, cloud, maker.table(), kUncertaintyUm);
    const double made = bench::thread_us();
    const auto& pose = tracker.follow(view, sequence);
    const double followed = bench::thread_us();
    append(ours, pose.alignment.motion);
    ours.insert(ours.end(), {pose.state == Tracker::State::lost ? 1.0 : 0.0, followed - before});
    if (surface.kind == recon::Surface::Kind::plane) {
      const double begun = bench::thread_us();
      const auto& flown = flow.follow(map.grid, cloud, view);
      const double end = bench::thread_us();
      append(flows, flown.motion);
      flows.insert(flows.end(), {flown.lost ? 1.0 : 0.0, end - begun + (made - before)});
    }
    save(folder / fmt::format("points_{:04}.npy", step), points_of(cloud, view),
         PointCloud::kParts);
  }
  save(folder / "truth.npy", truth, 52);
  save(folder / "tracker.npy", ours, 14);
  if (!flows.empty()) save(folder / "normal_flow.npy", flows, 14);
}

}  // namespace
}  // namespace dtact::pose

int main(int argc, char** argv) {
  using namespace dtact::pose;
  try {
    CLI::App app("Objects that move on the simulated layer, and how they are followed");
    std::filesystem::path out;
    std::string only;
    app.add_option("--out", out, "Folder, a folder in it for each sequence")->required();
    app.add_option("--only", only, "One object");
    CLI11_PARSE(app, argc, argv);
    const auto along_all_ways = [&](const Thing& thing, const char* name,
                                    const dtact::recon::Surface& surface) {
      for (const Way& way : {kSlide, kTwist, kRoll, kDeeper}) {
        constexpr int kSteps = 2 * Sequence::kFps / kEvery;
        follow(thing.lines, keys_of(way, kSteps), kSteps, kEvery,
               out / name / thing.name / way.name, surface);
      }
    };
    for (const Thing& thing : kThings) {
      if (!only.empty() && only != thing.name) continue;
      along_all_ways(thing, "plane", {});
    }
    for (const Thing& thing : kThings) {
      const std::string_view name = thing.name;
      if (name != "M4 nut" && name != "cube" && name != "ball array" && name != "key") continue;
      if (!only.empty() && only != name) continue;
      along_all_ways(thing, "sphere", kSphere);
      along_all_ways(thing, "cylinder", kCylinder);
    }
    for (const Thing& thing : kThings) {
      const std::string_view name = thing.name;
      if (name != "M4 nut" && name != "cube") continue;
      if (!only.empty() && only != name) continue;
      constexpr int kSteps = 60 * Sequence::kFps / kEveryOfAMinute;
      follow(thing.lines, keys_of_a_minute(kSteps), kSteps, kEveryOfAMinute,
             out / "plane" / thing.name / "minute");
    }
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "pose_sequences: {}\n", e.what());
    return 1;
  }
}
