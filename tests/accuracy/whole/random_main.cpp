// Judges scenes that are drawn at random: figures.md and scenes.csv in a folder, and the maps of
// each scene's worst frame in OUT/maps for page.py.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/whole/distribution.hpp"
#include "tests/accuracy/whole/random_scenes.hpp"

namespace {

/// The true map, then the measured one, both of 16 bits.
void write_maps(const dtact::whole::SceneReport& scene, const std::filesystem::path& folder) {
  std::string bytes;
  for (const auto* map : {&scene.true_map, &scene.map}) {
    bytes.append(reinterpret_cast<const char*>(map->data()), map->size() * sizeof(std::int16_t));
  }
  const std::string name =
      fmt::format("{:05.2f} {} {}.i16", scene.worst_ratio, scene.name, scene.map_width);
  dtact::base::write_file_atomically(folder / name, bytes);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app("Scenes that are drawn at random, through the whole program, against the truth");
    dtact::whole::RandomRun wanted;
    std::filesystem::path out;
    app.add_option("--seed", wanted.seed, "Other sensors and scenes")->capture_default_str();
    app.add_option("--sensors", wanted.sensors, "How many")->capture_default_str();
    app.add_option("--scenes", wanted.scenes_each, "On each sensor")->capture_default_str();
    app.add_option("--threads", wanted.threads, "How many")->capture_default_str();
    app.add_option("--only", wanted.only, "The name of the one scene to judge: s03.11");
    app.add_option("--work", wanted.folder, "Folder of calibrations; those there are used")
        ->required();
    app.add_option("--out", out, "Folder of the figures")->required();
    CLI11_PARSE(app, argc, argv);
    const auto scenes = dtact::whole::run(wanted);
    const auto maps = wanted.folder / "maps";
    std::filesystem::remove_all(maps);
    for (const auto& folder : {out, maps}) std::filesystem::create_directories(folder);
    for (const auto& scene : scenes) {
      if (scene.map_width > 0) write_maps(scene, maps);
    }
    dtact::base::write_file_atomically(out / "scenes.csv", dtact::whole::to_csv(scenes));
    dtact::base::write_file_atomically(out / "scenes.md", dtact::whole::to_markdown(scenes));
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "whole_random_scenes: {}\n", error.what());
    return 1;
  }
}
