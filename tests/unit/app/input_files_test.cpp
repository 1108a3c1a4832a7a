#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>

#include "daemon/app/files.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/registry.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::app {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

std::string error(const std::function<void()>& check) {
  try {
    check();
  } catch (const std::exception& e) {
    return e.what();
  }
  return "no error";
}

TEST(InputFiles, OneThatCannotBeReadNamesItsKey) {
  ::unsetenv("INVOCATION_ID");
  EXPECT_EQ(error([] { check_readable("calibration", ""); }), "no error");
  EXPECT_EQ(error([] { check_readable("calibration", "/tmp"); }), "no error");
  EXPECT_EQ(error([] { check_readable("calibration", "/no/such/folder"); }),
            "calibration = \"/no/such/folder\": No such file or directory");
}

// ProtectHome= and PrivateTmp= of the unit hide what its administrator sees.
TEST(InputFiles, TheServiceSaysWhatItDoesNotSee) {
  ::setenv("INVOCATION_ID", "0123456789abcdef0123456789abcdef", 1);
  EXPECT_THAT(error([] { check_readable("calibration", "/tmp/no/such"); }),
              AllOf(StartsWith("calibration = \"/tmp/no/such\": "),
                    HasSubstr("sees nothing in /home, /root and /tmp")));
  ::unsetenv("INVOCATION_ID");
}

TEST(InputFiles, OnlyTheCameraThatIsConfiguredReadsSome) {
  hal::CameraConfig camera;
  const auto said = [&camera] { return error([&camera] { check_camera_files(camera); }); };
  EXPECT_EQ(said(), "no error");
  camera.sim.scene = "/no/such/scene.toml";
  EXPECT_THAT(said(), StartsWith("camera.sim.scene = "));
  camera.backend = "replay";
  EXPECT_EQ(said(), "no error");
  camera.replay.folder = "/no/such/press.mcap";
  EXPECT_THAT(said(), AllOf(StartsWith("camera.replay.folder = "), Not(HasSubstr("service"))));
}

// What --check-config does beyond looking whether the files can be read.
TEST(InputFiles, ARecordingsFirstFrameIsDecoded) {
  const std::filesystem::path folder = fakes::own_path();
  std::filesystem::create_directories(folder);
  base::write_file_atomically(folder / "1.jpg", "\xff\xd8 no frame");
  hal::CameraConfig camera;
  camera.backend = "replay";
  camera.replay.folder = folder;
  EXPECT_EQ(error([&] { check_camera_files(camera); }), "no error");
  EXPECT_THAT(error([&] { app::check_devices({.camera = camera, .ring = {}}); }),
              StartsWith((folder / "1.jpg").string() + ": "));
  std::filesystem::remove_all(folder);
  camera.backend = "sim";
  camera.sim.scene = folder;
  EXPECT_THAT(error([&] { app::check_devices({.camera = camera, .ring = {}}); }),
              StartsWith("camera.sim.scene = "));
}

// Settings that no device could be opened with, though the file is well-formed.
TEST(InputFiles, SettingsOfDevicesFitEachOther) {
  const auto said = [](const hal::Config& config) {
    return error([&] { app::check_devices(config); });
  };
  hal::Config config;
  config.camera.backend = "v4l2";
  config.ring.backend = "ws2812_spi";
  EXPECT_EQ(said(config), "no error");
  hal::Config both = config;
  both.camera.v4l2.exposure_us = 5000;
  both.camera.v4l2.exposure_pwm_periods = 2;
  EXPECT_THAT(said(both), HasSubstr("not both"));
  hal::Config node = config;
  node.camera.v4l2.device = "video0";
  EXPECT_THAT(said(node), StartsWith("camera.v4l2.device = \"video0\""));
  hal::Config spi = config;
  spi.ring.ws2812.spi_bits = 8;
  EXPECT_THAT(said(spi), StartsWith("ring.ws2812.spi_hz: "));
  config.camera.backend = "libcamera";
  const auto without = HasSubstr("built without libcamera");
  hal::Config exposure = config;
  exposure.camera.libcamera.exposure_us = 20'000;  // at 60 frames a second
  EXPECT_THAT(said(exposure), AnyOf(HasSubstr("longer than a frame"), without));
  config.camera.libcamera.exposure_pwm_periods = 2;
  EXPECT_THAT(said(config), AnyOf(HasSubstr("camera.libcamera.pwm_hz"), without));
}

TEST(InputFiles, AModeThatTheCameraOrThePipelineLacksIsRefused) {
  const auto said = [](const hal::CameraConfig& camera) {
    return error([&] { app::check_devices({.camera = camera, .ring = {}}); });
  };
  hal::CameraConfig camera;  // sim
  EXPECT_EQ(said(camera), "no error");
  camera.fps = 0.5;
  EXPECT_THAT(said(camera), HasSubstr("no mode 800 x 600 at 0.5 frames a second"));
  camera.fps = 60;
  camera.width = 801;
  camera.sim.output = "yuyv";
  EXPECT_THAT(said(camera), StartsWith("camera.width = 801: "));
  camera.backend = "v4l2";
  EXPECT_EQ(said(camera), "no error") << "its driver knows";
  camera.width = 316;
  camera.height = 236;
  camera.decode_scale = 4;
  EXPECT_THAT(said(camera), StartsWith("camera v4l2 delivers 79x59 pixels; at least 80x60 "));
  camera.decode_scale = 2;
  EXPECT_EQ(said(camera), "no error");
}

TEST(InputFiles, AnUploadedCalibrationIsUsedInsteadOfTheConfiguredOne) {
  const std::filesystem::path folder = fakes::own_path();
  std::filesystem::create_directories(folder);
  Config config;
  config.state_dir = folder;
  config.calibration = "/no/such/own";
  EXPECT_FALSE(has_uploaded_calibration(config));
  std::filesystem::create_directory_symlink("calibrations/1/lid", folder / "calibration");
  EXPECT_TRUE(has_uploaded_calibration(config));
  std::filesystem::remove_all(folder);
}

// A real camera must never show depth by the simulated sensor's calibration.
TEST(InputFiles, OnlyTheSimulatedSensorHasACalibrationOfItsOwn) {
  Config config;
  EXPECT_EQ(config.sim_calibration, "/usr/share/dtactd/simulated");
  config.sim_calibration = "/no/such/simulated";
  for (const std::string& backend : hal::camera_backends()) {
    config.hal.camera.backend = backend;
    EXPECT_EQ(calibration_folder(config), backend == "sim" ? "/no/such/simulated" : "") << backend;
    EXPECT_THAT(error([&] { check_calibration(config); }),
                StartsWith(backend == "sim" ? "camera.sim.calibration = " : "no error"));
  }
  config.calibration = "/no/such/own";
  for (const std::string& backend : hal::camera_backends()) {
    config.hal.camera.backend = backend;
    EXPECT_EQ(calibration_folder(config), "/no/such/own") << backend;
    EXPECT_THAT(error([&] { check_calibration(config); }), StartsWith("calibration = "));
  }
}

TEST(StateFolder, HasOneOwnerWhoIsNamed) {
  const std::filesystem::path folder = fakes::own_path("state");
  std::filesystem::create_directories(folder);
  base::UniqueFd left = own_state_folder(folder, "left");
  const std::string refused = error([&] { (void)own_state_folder(folder, "right"); });
  EXPECT_THAT(refused,
              StartsWith("the state folder " + folder.string() + " belongs to dtactd, process " +
                         std::to_string(::getpid()) + ", sensor \"left\": "));
  EXPECT_THAT(refused, HasSubstr("state_dir"));
  left.reset();
  // What a power cut left of writes goes; everything else stays.
  for (const char* name : {"reference.png.aB3dE6", "calibration.starts.000000", "reference.png",
                           "reference.png.old"}) {
    base::write_file_atomically(folder / name, "");
  }
  EXPECT_TRUE(own_state_folder(folder, "right"));
  EXPECT_FALSE(std::filesystem::exists(folder / "reference.png.aB3dE6"));
  EXPECT_FALSE(std::filesystem::exists(folder / "calibration.starts.000000"));
  EXPECT_TRUE(std::filesystem::exists(folder / "reference.png"));
  EXPECT_TRUE(std::filesystem::exists(folder / "reference.png.old"));
  EXPECT_THAT(error([&] { (void)own_state_folder(folder / "no", "left"); }),
              HasSubstr("state_dir"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace dtact::app
