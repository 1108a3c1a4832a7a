// The configurations of config/boards are complete, load, and configure what their names say.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "daemon/app/config.hpp"
#include "hal/ws2812/encoder.hpp"

namespace dtact::app {
namespace {

namespace fs = std::filesystem;

const fs::path kBoards = fs::path(DTACT_SOURCE_DIR) / "config/boards";

struct Board {
  const char* file;
  const char* camera;
  const char* ring;
  const char* device;  ///< The ring's device file.
};
const std::vector<Board> kExpected{
    {"radxa-rock-5b-usb-spi.toml", "v4l2", "ws2812_spi", "/dev/spidev0.1"},
    {"raspberry-pi-4-usb-spi.toml", "v4l2", "ws2812_spi", "/dev/spidev0.0"},
    {"raspberry-pi-5-csi-spi.toml", "libcamera", "ws2812_spi", "/dev/spidev0.0"},
    {"raspberry-pi-5-usb-pio.toml", "v4l2", "ws2812_pio", "/dev/leds0"},
};

TEST(Boards, EachConfigurationIsForWhatItsNameSays) {
  for (const Board& board : kExpected) {
    const hal::Config config = load_config(kBoards / board.file, {}).config.hal;
    EXPECT_EQ(config.camera.backend, board.camera) << board.file;
    EXPECT_EQ(config.ring.backend, board.ring) << board.file;
    const hal::Ws2812Config& ring = config.ring.ws2812;
    EXPECT_EQ(config.ring.backend == "ws2812_pio" ? ring.pio_device : ring.spi_device, board.device)
        << board.file;
    EXPECT_EQ(hal::ws2812::why_refused({ring.spi_bits, static_cast<double>(ring.spi_hz)}), "")
        << board.file;
  }
}

// An exposure longer than a frame would slow the camera down.
TEST(Boards, TheExposureFitsIntoAFrame) {
  for (const Board& board : kExpected) {
    const hal::CameraConfig camera = load_config(kBoards / board.file, {}).config.hal.camera;
    const double exposure_us = std::max(camera.v4l2.exposure_us, camera.libcamera.exposure_us);
    EXPECT_LT(exposure_us, 1e6 / camera.fps) << board.file;
    // libcamera's default, 20 ms, does not fit.
    if (camera.backend == "libcamera") {
      EXPECT_GT(exposure_us, 0) << board.file;
    }
  }
}

TEST(Boards, NoConfigurationIsLeftOut) {
  std::set<std::string> expected;
  for (const Board& board : kExpected) expected.insert(board.file);
  std::set<std::string> found;
  for (const auto& entry : fs::directory_iterator(kBoards)) {
    if (entry.path().extension() == ".toml") found.insert(entry.path().filename());
  }
  EXPECT_EQ(found, expected);
}

}  // namespace
}  // namespace dtact::app
