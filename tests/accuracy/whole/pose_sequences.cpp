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
#include "hal/sim/placement.hpp"
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
  std::string head;  ///< A scene's tables that come before the press.
};

/// Everything when nothing is named.
bool is_wanted(const std::vector<std::string>& names, const char* name) {
  return names.empty() || std::ranges::find(names, name) != names.end();
}

const char* phase_of(const MotionFrames& frames, std::uint64_t n) {
  if (n <= frames.motion) return "press";
  return n < frames.end ? "motion" : "end";
}

std::string truth_line(const hal::sim::Truth& truth, const MotionFrames& frames, std::uint64_t n) {
  const hal::sim::Pose pose = truth.pose(0, n).value();
  const cv::Matx33d rotation = hal::sim::rotation_of(pose.turn_deg);
  std::string line = fmt::format("{},{}", n, truth.force_n(n) > 0 ? 1 : 0);
  for (const double value : rotation.val) line += fmt::format(",{:.12g}", value);
  for (const double value : {pose.x_mm, pose.y_mm, pose.z_mm})
    line += fmt::format(",{:.9g}", value);
  return line + fmt::format(",{}\n", phase_of(frames, n));
}

/// How much the layer shows of six directions of motion, at five moments of one.
std::string shape_csv(const hal::sim::Scene& scene, const MotionFrames& frames) {
  std::string csv =
      "sequence,x_mm,y_mm,z_mm,arm_mm,shown,turn_x,turn_y,turn_z,shift_x,shift_y,shift_z\n";
  constexpr std::uint64_t kParts = 4;
  for (std::uint64_t part = 0; part <= kParts; ++part) {
    const std::uint64_t n = frames.motion + (frames.end - frames.motion) * part / kParts;
    for (const ShownDirection& one : shown_directions(scene, n)) {
      csv += fmt::format("{},{:.4f},{:.4f},{:.4f},{:.4f},{:.5f}", n, one.direction.centre.x(),
                         one.direction.centre.y(), one.direction.centre.z(), one.direction.arm,
                         one.shown);
      for (const double value : one.direction.twist) csv += fmt::format(",{:.6f}", value);
      csv += '\n';
    }
  }
  return csv;
}

/// Runs the program from its start and keeps what belongs to a motion.
void record(const std::shared_ptr<const hal::sim::Truth>& truth, const fs::path& calibration,
            const MovingObject& object, const std::vector<ObjectMotion>& motions,
            const std::vector<MotionFrames>& choreography, const fs::path& out) {
  Program program(truth, calibration);
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
      csv += truth_line(*truth, frames, n);
    }
    if (!written.flush()) throw std::runtime_error(fmt::format("cannot write {}", file.string()));
    base::write_file_atomically(out / (name + ".truth.csv"), csv);
    fmt::print("{}\n", (out / name).string());
    std::fflush(stdout);
  }
}

void write_all(const Arguments& arguments) {
  std::vector<ObjectMotion> motions;
  std::ranges::copy_if(kObjectMotions, std::back_inserter(motions), [&](const auto& motion) {
    return is_wanted(arguments.motions, motion.name);
  });
  for (const MovingObject& object : kMovingObjects) {
    if (!is_wanted(arguments.objects, object.name)) continue;
    hal::sim::Scene scene = hal::sim::parse_scene(
        fmt::format("{}\n[[press]]\n{}\nkeys = [{{ t = 0.0 }}]\n", arguments.head, object.lines),
        object.name);
    const auto choreography = choreograph(object, motions, scene);
    std::vector<fs::path> folders;
    for (const fs::path& calibration : arguments.calibrations) {
      folders.push_back(arguments.out / calibration.filename());
    }
    if (folders.empty()) folders.push_back(arguments.out);
    for (std::size_t i = 0; i < motions.size(); ++i) {
      const std::string shape = shape_csv(scene, choreography[i]);
      for (const fs::path& folder : folders) {
        fs::create_directories(folder);
        base::write_file_atomically(
            folder / fmt::format("{}.{}.shape.csv", object.name, motions[i].name), shape);
      }
    }
    if (arguments.calibrations.empty()) continue;
    const auto truth = std::make_shared<const hal::sim::Truth>(scene);
    for (std::size_t i = 0; i < folders.size(); ++i) {
      record(truth, arguments.calibrations[i], object, motions, choreography, folders[i]);
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
                   "Folder; its frames come into a folder of the same name. May be repeated. None: "
                   "the shapes alone are written");
    app.add_option("--object", arguments.objects, "One object; may be repeated. None: all");
    app.add_option("--motion", arguments.motions, "One motion; may be repeated. None: all");
    app.add_option("--scene-head", arguments.head, "Tables of a scene: [camera], [surface], …");
    app.add_option("--out", arguments.out, "Folder")->required();
    CLI11_PARSE(app, argc, argv);
    dtact::whole::write_all(arguments);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "whole_pose_sequences: {}\n", e.what());
    return 1;
  }
}
