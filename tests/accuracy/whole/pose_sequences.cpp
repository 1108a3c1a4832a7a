// Objects that move on the simulated sensor: the frames that the daemon sends to dtact-perceive,
// and the true poses (sequence.hpp describes the files).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/sim/scene.hpp"
#include "hal/sim/truth.hpp"
#include "tests/accuracy/whole/moving_objects.hpp"
#include "tests/accuracy/whole/sequence.hpp"

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

/// All names are wanted when none is given.
bool is_wanted(const std::vector<std::string>& names, const char* name) {
  return names.empty() || std::ranges::find(names, name) != names.end();
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
    std::vector<std::vector<ShapeRow>> shapes;
    for (const MotionFrames& frames : choreography) shapes.push_back(shape_of(scene, frames));
    const auto truth = std::make_shared<const hal::sim::Truth>(scene);
    for (const fs::path& calibration : arguments.calibrations) {
      const fs::path folder = arguments.out / calibration.filename();
      record(truth, calibration, object, motions, choreography, shapes,
             [&folder](const Sequence& sequence) {
               save(sequence, folder);
               fmt::print("{}\n", (folder / sequence.name).string());
               std::fflush(stdout);
             });
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
    fmt::print(stderr, "pose_sequences: {}\n", e.what());
    return 1;
  }
}
