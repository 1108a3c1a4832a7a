#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "hal/sim/scene.hpp"
#include "tests/accuracy/whole/program.hpp"

namespace dtact::whole {

/// Draws that are the same with every standard library.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed) {}

  double uniform(double from, double to) {
    return from + (to - from) * static_cast<double>(engine_() >> 11U) * 0x1p-53;
  }
  double log_uniform(double from, double to) {
    return std::exp(uniform(std::log(from), std::log(to)));
  }
  int index(int count) { return std::min(count - 1, static_cast<int>(uniform(0, count))); }
  int between(int from, int to) { return from + index(to - from + 1); }
  bool chance(double share) { return uniform(0, 1) < share; }

 private:
  std::mt19937_64 engine_;
};

/// Similar numbers give seeds that differ much.
[[nodiscard]] std::uint64_t seed_of(std::uint64_t seed, int number);

/// A simulated sensor with its own gel, optics, light and camera, without presses.
struct RandomSensor {
  std::string name;  ///< "s03".
  std::uint64_t seed = 0;
  hal::sim::Scene scene;
  /// The camera distorts, so a user has to measure the lens.
  [[nodiscard]] bool has_lens() const noexcept { return scene.camera.barrel > 0; }
};

/// Difference of the light from the calibration's.
enum class LightCase : std::uint8_t {
  same,
  brighter,  ///< Another brightness of the whole field, from the start.
  led,       ///< One LED is dimmer or dead, from the start.
  drift,     ///< The whole field drifts by at most what the daemon follows, 2 % a minute.
  led_fails  ///< One LED dims or dies after the reference was taken.
};
[[nodiscard]] const char* name_of(LightCase light) noexcept;

/// State of the object in a judged frame.
enum class Phase : std::uint8_t { before, moving, rest, slide, after };
[[nodiscard]] const char* name_of(Phase phase) noexcept;

struct JudgedFrame {
  std::uint64_t sequence = 0;
  Phase phase = Phase::before;
};

/// A scene on one sensor.
struct RandomScene {
  std::string name;  ///< "s03.11".
  std::string what;  ///< Description: objects, sizes, depths, motion and light.
  std::uint64_t seed = 0;
  hal::sim::Scene scene;
  LightCase light = LightCase::same;
  std::function<Lighting(std::uint64_t sequence)> lighting;
  std::vector<JudgedFrame> judged;  ///< Ascending.
};

/// Draws sensor `number` of `seed`.
[[nodiscard]] RandomSensor draw_sensor(std::uint64_t seed, int number);

/// Draws scene `number` on a sensor. Depth reaches 0.8 of the gel.
[[nodiscard]] RandomScene draw_scene(const RandomSensor& sensor, int number);

/// Solves the scene's contacts, with all presses made shallower until at most kMaxNewtons press.
[[nodiscard]] std::shared_ptr<const hal::sim::Truth> solve_eased(RandomScene& scene);
inline constexpr double kMaxNewtons = 30;

}  // namespace dtact::whole
