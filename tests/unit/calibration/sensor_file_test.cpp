#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "daemon/calibration/sensor_files.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::calibration {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(SensorFile, ComesBack) {
  const TempFolder temp;
  const std::filesystem::path file = temp.path() / kSensorName;
  Origin origin;
  origin.camera = "usb-0:1.2 \"left\"\\";
  origin.pixel_format = "MJPEG";
  origin.fps = 59.94;
  origin.controls = {{"exposure absolute", 157}, {"gain", -3}};
  origin.leds = {255, 128, 0};
  base::write_file_atomically(file, format_sensor(origin));
  const Origin read = load_sensor(file);
  EXPECT_EQ(read.camera, origin.camera);
  EXPECT_EQ(read.pixel_format, "MJPEG");
  EXPECT_EQ(read.fps, 59.94);
  ASSERT_EQ(read.controls.size(), 2U);
  EXPECT_EQ(read.controls[1].name, "gain");
  EXPECT_EQ(read.controls[1].value, -3);
  EXPECT_EQ(read.leds, origin.leds);
}

TEST(SensorFile, NamesWhatIsWrong) {
  const TempFolder temp;
  const std::filesystem::path file = temp.path() / kSensorName;
  base::write_file_atomically(file, "version = 1\n[camera]\nidentity = 3\n");
  EXPECT_THAT([&] { (void)load_sensor(file); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("sensor.toml:3"), HasSubstr("camera.identity"))));
}

}  // namespace
}  // namespace dtact::calibration
