#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace dtact::hal {

/// The simulated sensor.
struct SimConfig {
  std::filesystem::path scene;   ///< TOML scene; empty = the built-in default scene.
  std::uint64_t seed = 1;        ///< Noise and nothing else depends on it.
  std::string output = "mjpeg";  ///< "luma", "yuyv" or "mjpeg": the payload the HAL decodes.
  bool paced = true;             ///< false: a frame whenever one is asked for (tests, benchmarks).
};

/// Recorded frames.
struct ReplayConfig {
  std::filesystem::path folder;  ///< PNG or JPEG frames, played in the order of their names.
  bool loop = true;
  bool paced = true;  ///< false: as fast as they are asked for.
};

struct CameraConfig {
  std::string backend = "sim";  ///< A name the registry knows.
  int width = 800;              ///< Pixels.
  int height = 600;             ///< Pixels.
  double fps = 60;              ///< Frames a second.
  SimConfig sim;
  ReplayConfig replay;
};

struct RingConfig {
  std::string backend = "sim";
};

struct Config {
  CameraConfig camera;
  RingConfig ring;
};

}  // namespace dtact::hal
