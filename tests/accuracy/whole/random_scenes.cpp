#include "tests/accuracy/whole/random_scenes.hpp"

#include <fmt/format.h>

#include <atomic>
#include <cstdio>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/whole/sensor_calibration.hpp"

namespace dtact::whole {

std::vector<SceneReport> run(const RandomRun& wanted) {
  namespace fs = std::filesystem;
  std::vector<std::vector<SceneReport>> all(static_cast<std::size_t>(wanted.sensors));
  std::atomic<int> next = 0;
  std::mutex mutex;
  std::exception_ptr failed;
  const auto work = [&] {
    for (int number = next++; number < wanted.sensors; number = next++) {
      try {
        const RandomSensor sensor = draw_sensor(wanted.seed, number);
        if (!wanted.only.starts_with(wanted.only.empty() ? "" : sensor.name)) continue;
        const fs::path calibration = wanted.folder / sensor.name;
        if (!fs::exists(calibration)) {
          base::write_file_atomically(wanted.folder / (sensor.name + ".txt"),
                                      calibrate(sensor, calibration));
        }
        for (int i = 0; i < wanted.scenes_each; ++i) {
          const RandomScene scene = draw_scene(sensor, i);
          if (!wanted.only.empty() && scene.name != wanted.only) continue;
          SceneReport report = judge(scene, calibration);
          const std::scoped_lock lock(mutex);
          fmt::print("{} {:.2f} {}\n", report.name, report.worst_ratio, report.what);
          std::fflush(stdout);
          all[static_cast<std::size_t>(number)].push_back(std::move(report));
        }
      } catch (const std::exception& error) {
        const std::scoped_lock lock(mutex);
        fmt::print("sensor {}: {}\n", number, error.what());
        failed = std::current_exception();
      }
    }
  };
  fs::create_directories(wanted.folder);
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < wanted.threads; ++i) threads.emplace_back(work);
  }
  if (failed) std::rethrow_exception(failed);
  std::vector<SceneReport> flat;
  for (auto& sensor : all) {
    for (SceneReport& report : sensor) flat.push_back(std::move(report));
  }
  return flat;
}

}  // namespace dtact::whole
