#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/serve/frame_kind.hpp"
#include "hal/sim/light_field.hpp"
#include "hal/sim/truth.hpp"

namespace dtact::whole {

/// dtact-perceive's subscription for a client of the contact's points and pose: depth at full
/// resolution, cut to the contact and a margin. No depth without contact.
[[nodiscard]] net::FrameKind perceive_kind();

/// The whole map in every frame, for a client that subscribes to depth only.
[[nodiscard]] net::FrameKind whole_map_kind();

/// Solves the contacts of a scene's text (the keys of config/scenes/default.toml), about 50 ms a
/// map. Throws std::runtime_error naming the key that is wrong.
[[nodiscard]] std::shared_ptr<const hal::sim::Truth> solve(std::string_view scene);

/// Transform from the simulator's surface frame to the calibration's, whose origin is the middle of
/// the depth map, millimetres. With a calibrated lens they differ by the board's position.
struct MapFrame {
  Eigen::Isometry3d from_scene;
  double scale = 1;   ///< Millimetres of the map for one of the scene.
  double rms_mm = 0;  ///< Residual: the error of the lens.
};
[[nodiscard]] MapFrame map_frame(const hal::sim::Scene& scene,
                                 const std::filesystem::path& calibration);

/// Light under which a frame is exposed.
struct Lighting {
  hal::sim::LedLevels leds = hal::sim::led_levels({});
  double gain = 1;  ///< Factor on the brightness, 0.25 … 4.
};

/// Settings of the program. Default: a daemon without a configuration.
struct Settings {
  pipeline::PipelineConfig daemon;
  net::FrameKind kind = perceive_kind();
  std::uint64_t seed = 1;        ///< Seed of the camera's noise.
  std::string output = "mjpeg";  ///< The camera's format: "luma", "yuyv" or "mjpeg".
  /// Light of each frame; none: all LEDs as the ring shows them.
  std::function<Lighting(std::uint64_t sequence)> lighting;
};

/// The simulated camera, the daemon's capture loop and its frame encoder in one thread and in the
/// camera's own time: the same truth and settings give the same depth. The ring keeps its light
/// from the start. The reference is taken in the first 45 frames, which must be contact-free.
class Program {
 public:
  /// Throws std::runtime_error when `calibration`, a folder, cannot be read, and
  /// std::invalid_argument when it is for another camera mode.
  Program(const std::shared_ptr<const hal::sim::Truth>& truth,
          const std::filesystem::path& calibration, const Settings& settings = {});
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// The next camera frame, whose sequence is the scene's (0, 1, …), as the serialised v1::Frame of
  /// Settings::kind.
  [[nodiscard]] std::string next();
  /// The same frame for a client of another kind.
  [[nodiscard]] std::string as(const net::FrameKind& kind);
  /// The same frame as the capture loop publishes it: depth in micrometres, contact, health.
  [[nodiscard]] const pipeline::DepthFrame& frame() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::whole
