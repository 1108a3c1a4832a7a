#include "hal/libcamera/formats.hpp"

#include <gtest/gtest.h>
#include <libcamera/property_ids.h>

#include "hal/live/source.hpp"
#include "tests/unit/libcamera/pi_camera.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;
using libcamera_test::IgnorantCamera;
using libcamera_test::PiCamera;
using live::Encoding;

CameraConfig asked(int width, int height, const char* format = "auto") {
  CameraConfig c;
  c.width = width;
  c.height = height;
  c.libcamera.pixel_format = format;
  return c;
}

/// imx219.c: a colour sensor with 10 and 8 bits.
const std::vector<PiCamera::Mode> kImx219{
    {{3280, 2464}, 10}, {{1640, 1232}, 10}, {{640, 480}, 10}, {{1640, 1232}, 8}, {{640, 480}, 8}};
/// ov9282.c, which drives the mono OV9281: 10 bits, and 8 bits in newer kernels.
const std::vector<PiCamera::Mode> kOv9281Old{{{1280, 800}, 10}, {{640, 400}, 10}};
const std::vector<PiCamera::Mode> kOv9281{
    {{1280, 800}, 10}, {{640, 400}, 10}, {{1280, 800}, 8}, {{640, 400}, 8}};

struct Got {
  Choice choice;
  live::Format format;
};

Got choose(lc::CameraConfiguration& camera, const CameraConfig& config, Sensor sensor) {
  const Choice choice = choose_format(camera, config, sensor, "csi");
  return {choice, format_of(camera.at(0), choice)};
}

TEST(Formats, AsksAPiForFullRangeWhereVideoIsLimited) {
  PiCamera camera(PiCamera::Board::pi4, kImx219);
  const Got got = choose(camera, asked(800, 600), Sensor::colour);
  EXPECT_STREQ(got.choice.name, "NV12");
  EXPECT_EQ(got.format.encoding, Encoding::grey);
  EXPECT_TRUE(got.format.full_range);
  EXPECT_EQ(got.format.width, 800);
  EXPECT_EQ(got.format.bytes_per_line, 832);
}

TEST(Formats, SaysLimitedWhereFullRangeIsNotGranted) {
  PiCamera camera(PiCamera::Board::pi5, kImx219);
  camera.grant_only(lc::ColorSpace::Rec709);
  EXPECT_FALSE(choose(camera, asked(800, 600, "yuv420"), Sensor::colour).format.full_range);
}

// Otherwise its limited range would count as full, since the requested value stays there.
TEST(Formats, AsksNoColourSpaceOfAPipelineThatKnowsNone) {
  IgnorantCamera camera;
  const Got got = choose(camera, asked(800, 600), Sensor::none);
  EXPECT_FALSE(got.format.full_range);
  EXPECT_FALSE(camera.at(0).colorSpace.has_value());
}

TEST(Formats, TakesAMonoSensorsOwnGrey) {
  PiCamera camera(PiCamera::Board::pi4, kOv9281);
  const Got got = choose(camera, asked(1280, 800), Sensor::mono);
  EXPECT_STREQ(got.choice.name, "GREY");
  EXPECT_TRUE(got.format.full_range);
  EXPECT_EQ(got.format.bytes_per_line, 1280);
}

TEST(Formats, TakesTenBitsOfASensorWithoutEight) {
  PiCamera camera(PiCamera::Board::pi4, kOv9281Old);
  const Got got = choose(camera, asked(640, 400), Sensor::mono);
  EXPECT_STREQ(got.choice.name, "Y10");
  EXPECT_EQ(got.format.encoding, Encoding::grey10);
  EXPECT_TRUE(got.format.full_range);
  EXPECT_EQ(got.format.bytes_per_line, 1280);
}

TEST(Formats, TakesTheSixteenBitsThatAPi5MakesOfAMonoSensor) {
  PiCamera camera(PiCamera::Board::pi5, kOv9281);
  const Got got = choose(camera, asked(1280, 800), Sensor::mono);
  EXPECT_STREQ(got.choice.name, "Y16");
  EXPECT_EQ(got.format.encoding, Encoding::grey16);
  EXPECT_TRUE(got.format.full_range);
}

TEST(Formats, LetsTheImageProcessorScaleAMonoSensor) {
  PiCamera camera(PiCamera::Board::pi4, kOv9281);
  const Got got = choose(camera, asked(800, 600), Sensor::mono);
  EXPECT_STREQ(got.choice.name, "NV12");
  EXPECT_TRUE(got.format.full_range);
}

// A Pi 4 would grant R8 at 640x480: the mosaic of a colour sensor, named grey.
TEST(Formats, TakesNoMosaicForGrey) {
  PiCamera camera(PiCamera::Board::pi4, kImx219);
  EXPECT_STREQ(choose(camera, asked(640, 480), Sensor::colour).choice.name, "NV12");
  PiCamera grey(PiCamera::Board::pi4, kImx219);
  EXPECT_THROW((void)choose(grey, asked(640, 480, "grey"), Sensor::colour), live::ModeError);
}

TEST(Formats, NamesWhatThereIs) {
  IgnorantCamera camera;
  try {
    (void)choose(camera, asked(640, 480), Sensor::none);
    FAIL();
  } catch (const live::ModeError& e) {
    EXPECT_NE(std::string(e.what()).find("csi has no mode 640x480"), std::string::npos) << e.what();
  }
}

TEST(Formats, TakesABareSensorsMemoryForUncached) {
  EXPECT_TRUE(driver_memory_is_cached(Sensor::none));
  EXPECT_FALSE(driver_memory_is_cached(Sensor::mono));
  EXPECT_FALSE(driver_memory_is_cached(Sensor::colour));
}

TEST(Formats, KnowsBareSensorsByTheirColourFilters) {
  lc::ControlList properties(lc::properties::properties);
  EXPECT_EQ(sensor_of(properties), Sensor::none);
  properties.set(lc::properties::draft::ColorFilterArrangement, lc::properties::draft::MONO);
  EXPECT_EQ(sensor_of(properties), Sensor::mono);
  properties.set(lc::properties::draft::ColorFilterArrangement, lc::properties::draft::RGGB);
  EXPECT_EQ(sensor_of(properties), Sensor::colour);
}

}  // namespace
}  // namespace dtact::hal::libcamera_backend
