#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/pipeline/depth_frame.hpp"

/// Depth maps of a ball held in contact, computed like in the daemon: active tiles only,
/// 0 elsewhere.
namespace dtact::bench {

struct Recording {
  std::string name;  ///< What it shows.
  std::vector<pipeline::DepthFrame> frames;
};

/// The built-in scene as the simulated camera sends it (MJPEG) while its first press is held, with
/// a calibration that was built from the images of config/scenes/calibrate_ball.toml.
[[nodiscard]] Recording simulated_ball(int frames);

/// One picture of a real sensor, `folder`/ball.png against ball_reference.png, with a calibration
/// that was built from the two without a lens. Throws std::runtime_error naming a file.
[[nodiscard]] Recording real_ball(const std::filesystem::path& folder, double mm_per_px);

}  // namespace dtact::bench
