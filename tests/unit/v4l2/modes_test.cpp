#include "hal/v4l2/modes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include "hal/live/payload.hpp"
#include "hal/v4l2/node.hpp"

namespace dtact::hal::v4l2 {
namespace {

Mode mode(std::uint32_t fourcc, int width, int height, std::vector<double> fps) {
  Mode m;
  m.fourcc = fourcc;
  m.width = m.min_width = width;
  m.height = m.min_height = height;
  m.fps = std::move(fps);
  return m;
}

CameraConfig asked(int width, int height, double fps, const char* format = "auto") {
  CameraConfig c;
  c.width = width;
  c.height = height;
  c.fps = fps;
  c.v4l2.pixel_format = format;
  return c;
}

const std::vector<Mode> kModes{mode(V4L2_PIX_FMT_MJPEG, 800, 600, {60.00024, 30.00003}),
                               mode(V4L2_PIX_FMT_YUYV, 800, 600, {30.00003}),
                               mode(V4L2_PIX_FMT_H264, 1920, 1080, {60})};

TEST(Modes, PrefersRawLumaWhereTheRateAllows) {
  EXPECT_EQ(choose(kModes, asked(800, 600, 60), "cam"), V4L2_PIX_FMT_MJPEG);
  EXPECT_EQ(choose(kModes, asked(800, 600, 30), "cam"), V4L2_PIX_FMT_YUYV);
  EXPECT_EQ(choose(kModes, asked(800, 600, 30, "mjpeg"), "cam"), V4L2_PIX_FMT_MJPEG);
}

TEST(Modes, JpegIsMotionJpegByAnotherName) {
  const std::vector<Mode> modes{mode(V4L2_PIX_FMT_JPEG, 800, 600, {60})};
  EXPECT_EQ(choose(modes, asked(800, 600, 60), "cam"), V4L2_PIX_FMT_JPEG);
  EXPECT_EQ(choose(modes, asked(800, 600, 60, "mjpeg"), "cam"), V4L2_PIX_FMT_JPEG);
  EXPECT_EQ(describe(modes), "MJPEG 800x600 at 60");
}

TEST(Modes, NamesWhatIsOffered) {
  EXPECT_THROW((void)choose(kModes, asked(800, 600, 60, "yuyv"), "cam"), ModeError);
  EXPECT_THROW((void)choose(kModes, asked(1920, 1080, 60), "cam"), ModeError);  // H264 is no luma
  EXPECT_THROW((void)choose({}, asked(800, 600, 60), "cam"), ModeError);
  EXPECT_EQ(describe(kModes), "MJPEG 800x600 at 60, 30; YUYV 800x600 at 30; H264 1920x1080 at 60");
  EXPECT_EQ(describe({}), "nothing (the driver lists no mode)");
}

TEST(Modes, NamesTheModesThatWouldDo) {
  try {
    (void)choose(kModes, asked(800, 600, 120), "cam");
    FAIL() << "no error";
  } catch (const ModeError& e) {
    EXPECT_STREQ(e.what(),
                 "cam has no mode 800x600 at 120 frames a second: set camera.width, camera.height, "
                 "camera.fps and camera.v4l2.pixel_format to one of: MJPEG 800x600 at 60, 30; "
                 "YUYV 800x600 at 30");
  }
  // A size that would do with another rate comes first.
  const std::vector<Mode> modes{mode(V4L2_PIX_FMT_MJPEG, 1280, 720, {60}),
                                mode(V4L2_PIX_FMT_H264, 800, 600, {60}),
                                mode(V4L2_PIX_FMT_YUYV, 800, 600, {30})};
  EXPECT_EQ(alternatives(modes, asked(800, 600, 60)), "YUYV 800x600 at 30; MJPEG 1280x720 at 60");
  EXPECT_EQ(alternatives({modes[1]}, asked(800, 600, 60)),
            "nothing (it has only H264 800x600 at 60, which cannot be read; of a bare sensor's raw "
            "Bayer camera.backend = \"libcamera\" makes an image)");
  EXPECT_EQ(alternatives({}, asked(800, 600, 60)), "nothing (the driver lists no mode)");
}

TEST(Modes, RangesOfSizesAndRates) {
  Mode range = mode(V4L2_PIX_FMT_GREY, 1920, 1080, {120, 1});
  range.min_width = 64;
  range.min_height = 48;
  range.fps_is_range = true;
  EXPECT_TRUE(range.offers(800, 600, 59.94));
  EXPECT_FALSE(range.offers(800, 600, 121));
  EXPECT_FALSE(range.offers(1921, 600, 60));
  EXPECT_FALSE(range.offers(32, 48, 60));
  // The ends of the three ranges.
  EXPECT_TRUE(range.offers(1920, 1080, 120));
  EXPECT_TRUE(range.offers(64, 48, 1));
  EXPECT_TRUE(range.has_size(64, 1080));
  EXPECT_FALSE(range.has_size(63, 48));
  EXPECT_FALSE(range.has_size(64, 47));
  EXPECT_FALSE(range.has_size(1920, 1081));
  EXPECT_FALSE(range.has_size(1080, 1920));
  EXPECT_FALSE(range.offers(800, 600, 0));
  EXPECT_EQ(describe({range}), "GREY 64x48...1920x1080 at 120...1");
  EXPECT_TRUE(mode(V4L2_PIX_FMT_GREY, 8, 8, {}).offers(8, 8, 1000));
}

TEST(Modes, ChecksTheConfiguredFormat) {
  EXPECT_NO_THROW(check_pixel_format("auto"));
  EXPECT_NO_THROW(check_pixel_format("nv12"));
  EXPECT_THROW(check_pixel_format("h264"), std::runtime_error);
  EXPECT_THROW(check_pixel_format(""), std::runtime_error);
}

using live::PayloadDecoder;
using live::PayloadStatus;

TEST(Modes, OnlyMjpegIsDecodedAtASmallerSize) {
  CameraConfig half = asked(800, 600, 30);
  half.decode_scale = 2;
  EXPECT_EQ(choose(kModes, half, "cam"), V4L2_PIX_FMT_MJPEG);
  EXPECT_THAT([&] { (void)choose({mode(V4L2_PIX_FMT_YUYV, 800, 600, {30})}, half, "cam"); },
              testing::ThrowsMessage<ModeError>(
                  testing::HasSubstr("in mjpeg, which camera.decode_scale needs")));
}

TEST(Payload, FindsAJpegsMarkersUnderPadding) {
  live::Format format;
  format.encoding = live::Encoding::jpeg;
  format.width = format.height = 8;
  const PayloadDecoder decoder(format);
  const auto inspect = [&](const std::vector<std::uint8_t>& payload) {
    live::FilledBuffer filled;
    filled.payload = payload;
    return decoder.inspect(filled);
  };
  EXPECT_EQ(inspect({0xFF, 0xD8, 1, 2, 0xFF, 0xD9}), PayloadStatus::ok);
  EXPECT_EQ(inspect({0xFF, 0xD8, 1, 2, 0xFF, 0xD9, 0, 0, 0}), PayloadStatus::ok);
  EXPECT_EQ(inspect({0xFF, 0xD8, 1, 2, 0xFF, 0xD9, 0xFF}), PayloadStatus::ok);
  EXPECT_EQ(inspect({0xFF, 0xD8, 1, 2, 3, 4}), PayloadStatus::markers);
  EXPECT_EQ(inspect({0, 0xD8, 1, 2, 0xFF, 0xD9}), PayloadStatus::markers);
  EXPECT_EQ(inspect({0xFF, 0xD8}), PayloadStatus::markers);
  EXPECT_EQ(inspect({0xFF, 0xD8, 0, 0, 0, 0}), PayloadStatus::markers);
  EXPECT_EQ(inspect({}), PayloadStatus::too_short);
}

}  // namespace
}  // namespace dtact::hal::v4l2
