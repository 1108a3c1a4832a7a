// Objects that move on the simulated sensor: the frames that the daemon sends to dtact-perceive,
// and where the objects truly are. NAME.frames: each frame is a big-endian length of four bytes and
// a v1::Frame. NAME.truth.csv: a line for each of them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "proto/framing.hpp"
#include "tests/accuracy/whole/moving_objects.hpp"
#include "tests/accuracy/whole/program.hpp"
#include "tests/accuracy/whole/shape.hpp"

namespace dtact::whole {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<fs::path> calibrations;
  std::vector<std::string> objects;
  std::vector<std::string> motions;
  fs::path out;
  fs::path head;  ///< A scene's tables that come before the press; empty: none.
};

/// Everything when nothing is named.
bool is_wanted(const std::vector<std::string>& names, const char* name) {
  return names.empty() || std::ranges::find(names, name) != names.end();
}

const char* phase_of(const MotionFrames& frames, std::uint64_t n) {
  if (n <= frames.motion) return "press";
  return n < frames.end ? "motion" : "end";
}

std::string truth_line(const hal::sim::Truth& truth, const Eigen::Isometry3d& map_from_scene,
                       const MotionFrames& frames, std::uint64_t n) {
  const Eigen::Isometry3d pose = map_from_scene * isometry_of(truth.pose(0, n).value());
  std::string line = fmt::format("{},{}", n, truth.force_n(n) > 0 ? 1 : 0);
  for (int i = 0; i < 9; ++i) line += fmt::format(",{:.12g}", pose.linear()(i / 3, i % 3));
  for (const double value : pose.translation()) line += fmt::format(",{:.9g}", value);
  return line + fmt::format(",{}\n", phase_of(frames, n));
}

/// How much the layer shows of six directions of motion in a frame.
struct Shown {
  std::uint64_t sequence = 0;
  std::array<ShownDirection, 6> directions;
};

/// At five moments of a motion.
std::vector<Shown> shown_of(const hal::sim::Scene& scene, const MotionFrames& frames) {
  constexpr std::uint64_t kParts = 4;
  std::vector<Shown> shown;
  for (std::uint64_t part = 0; part <= kParts; ++part) {
    const std::uint64_t n = frames.motion + (frames.end - frames.motion) * part / kParts;
    shown.push_back({n, shown_directions(scene, n)});
  }
  return shown;
}

std::string shape_csv(const std::vector<Shown>& shown, const Eigen::Isometry3d& map_from_scene) {
  std::string csv =
      "sequence,x_mm,y_mm,z_mm,arm_mm,shown,turn_x,turn_y,turn_z,shift_x,shift_y,shift_z\n";
  for (const Shown& moment : shown) {
    for (const ShownDirection& one : moment.directions) {
      const Direction direction = carried(one.direction, map_from_scene);
      csv += fmt::format("{}", moment.sequence);
      for (const double value : direction.centre) csv += fmt::format(",{:.4f}", value);
      csv += fmt::format(",{:.4f},{:.5f}", direction.arm, one.shown);
      for (const double value : direction.twist) csv += fmt::format(",{:.6f}", value);
      csv += '\n';
    }
  }
  return csv;
}

/// Runs the program from its start and keeps what belongs to a motion.
void record(const std::shared_ptr<const hal::sim::Truth>& truth, const fs::path& calibration,
            const MovingObject& object, const std::vector<ObjectMotion>& motions,
            const std::vector<MotionFrames>& choreography,
            const std::vector<std::vector<Shown>>& shown, const fs::path& out) {
  fs::create_directories(out);
  Program program(truth, calibration);
  const Eigen::Isometry3d map_from_scene = map_frame(truth->scene(), calibration).from_scene;
  std::uint64_t n = 0;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const MotionFrames& frames = choreography[i];
    for (; n < frames.first; ++n) (void)program.next();
    const std::string name = fmt::format("{}.{}", object.name, motions[i].name);
    const fs::path file = out / (name + ".frames");
    std::ofstream written(file, std::ios::binary);
    std::string csv =
        "sequence,in_contact,r11,r12,r13,r21,r22,r23,r31,r32,r33,x_mm,y_mm,z_mm,phase\n";
    for (; n <= frames.last; ++n) {
      const std::string frame = program.next();
      const auto length = wire::encode_length(frame.size());
      written.write(reinterpret_cast<const char*>(length.data()), std::ssize(length));
      written.write(frame.data(), std::ssize(frame));
      csv += truth_line(*truth, map_from_scene, frames, n);
    }
    if (!written.flush()) throw std::runtime_error(fmt::format("cannot write {}", file.string()));
    base::write_file_atomically(out / (name + ".shape.csv"), shape_csv(shown[i], map_from_scene));
    base::write_file_atomically(out / (name + ".truth.csv"), csv);
    fmt::print("{}\n", (out / name).string());
    std::fflush(stdout);
  }
}

void write_all(const Arguments& arguments) {
  const std::string head = arguments.head.empty() ? "" : base::read_file(arguments.head);
  std::vector<ObjectMotion> motions;
  std::ranges::copy_if(common_motions(), std::back_inserter(motions), [&](const auto& motion) {
    return is_wanted(arguments.motions, motion.name);
  });
  std::ranges::copy_if(long_motions(), std::back_inserter(motions), [&](const auto& motion) {
    return !arguments.motions.empty() && is_wanted(arguments.motions, motion.name);
  });
  for (const MovingObject& object : kMovingObjects) {
    if (!is_wanted(arguments.objects, object.name)) continue;
    hal::sim::Scene scene = hal::sim::parse_scene(
        fmt::format("{}\n[[press]]\n{}\nkeys = [{{ t = 0.0 }}]\n", head, object.lines),
        object.name);
    const auto choreography = choreograph(object, motions, scene);
    std::vector<std::vector<Shown>> shown;
    for (const MotionFrames& frames : choreography) shown.push_back(shown_of(scene, frames));
    const auto truth = std::make_shared<const hal::sim::Truth>(scene);
    for (const fs::path& calibration : arguments.calibrations) {
      record(truth, calibration, object, motions, choreography, shown,
             arguments.out / calibration.filename());
    }
  }
}

}  // namespace
}  // namespace dtact::whole

int main(int argc, char** argv) {
  try {
    CLI::App app("Objects that move on the simulated sensor, as the daemon sends them");
    dtact::whole::Arguments arguments;
    app.add_option("--calibration", arguments.calibrations,
                   "Folder; its frames come into a folder of the same name. May be repeated")
        ->required();
    app.add_option("--object", arguments.objects, "One object; may be repeated. None: all");
    app.add_option(
        "--motion", arguments.motions,
        "One motion: turn, slide, roll, deeper, all, minute or drag; may be repeated. None: "
        "all but the last two");
    app.add_option("--scene-head", arguments.head,
                   "File with tables of a scene: [camera], [surface], …");
    app.add_option("--out", arguments.out, "Folder")->required();
    CLI11_PARSE(app, argc, argv);
    dtact::whole::write_all(arguments);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "whole_pose_sequences: {}\n", e.what());
    return 1;
  }
}
