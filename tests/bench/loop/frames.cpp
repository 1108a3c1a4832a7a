// loop_frames SCENE FIRST END FOLDER: frames of a simulated scene in the simulated camera's JPEG
// format, as files for the replay backend.
#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/luma/luma.hpp"
#include "hal/sim/payload.hpp"
#include "hal/sim/renderer.hpp"
#include "hal/sim/scene.hpp"

int main(int argc, char** argv) {
  namespace sim = dtact::hal::sim;
  if (argc != 5) {
    fmt::print(stderr, "usage: loop_frames SCENE FIRST END FOLDER\n");
    return 2;
  }
  try {
    const sim::Scene scene = sim::load_scene(argv[1]);
    const std::filesystem::path folder = argv[4];
    std::filesystem::create_directories(folder);
    sim::Renderer renderer(scene, 1);
    const sim::LedLevels light = sim::led_levels(dtact::hal::Light{.brightness = 255});
    dtact::hal::luma::LumaBuffer image(scene.camera.width, scene.camera.height);
    sim::PayloadEncoder encoder(sim::Output::mjpeg, image.width(), image.height());
    std::vector<std::uint8_t> payload(encoder.capacity());
    for (std::uint64_t n = std::stoull(argv[2]); n < std::stoull(argv[3]); ++n) {
      renderer.render(n, light, image.data(), image.stride(), image.height());
      const std::size_t size = encoder.encode(image.view(), payload);
      dtact::base::write_file_atomically(
          folder / fmt::format("{:06}.jpg", n),
          std::string_view(reinterpret_cast<const char*>(payload.data()), size));
    }
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "loop_frames: {}\n", e.what());
    return 1;
  }
}
