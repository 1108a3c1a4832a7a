#pragma once

#include <libcamera/camera.h>
#include <libcamera/formats.h>

#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

namespace dtact::libcamera_test {

namespace lc = libcamera;

/// 'R16 ' of drm_fourcc.h; libcamera 0.0.3 has no name for it.
constexpr lc::PixelFormat kR16(0x20363152);

/// A double of a Raspberry Pi's camera, for one stream: it changes requests as raspberrypi's
/// libcamera does, in src/libcamera/pipeline/rpi/common/pipeline_base.cpp (generateConfiguration(),
/// validateColorSpaces(), validate()), rpi/vc4/vc4.cpp and rpi/pisp/pisp.cpp (platformValidate()).
class PiCamera : public lc::CameraConfiguration {
 public:
  enum class Board { pi4, pi5 };
  struct Mode {
    lc::Size size;
    unsigned bits;
  };

  PiCamera(Board board, std::vector<Mode> modes) : board_(board), modes_(std::move(modes)) {
    lc::StreamConfiguration stream(
        lc::StreamFormats({{lc::formats::YUV420, {{{16, 16}, {4056, 3040}}}},
                           {lc::formats::NV12, {{{16, 16}, {4056, 3040}}}}}));
    stream.pixelFormat = lc::formats::YUV420;
    stream.size = {1920, 1080};
    stream.colorSpace = lc::ColorSpace::Rec709;  // generateConfiguration(), for VideoRecording
    addConfiguration(stream);
  }

  /// The image processor's driver grants this colour space whatever is asked for (tryFormat()).
  void grant_only(const lc::ColorSpace& space) { granted_ = space; }

  Status validate() override {
    lc::StreamConfiguration& stream = config_[0];
    stream.bufferCount = 4;
    // isRaw(): grey that sensors send, too.
    if (stream.pixelFormat == lc::formats::R8 || stream.pixelFormat == lc::formats::R10 ||
        stream.pixelFormat == kR16) {
      validate_raw(stream);
    } else {
      if (stream.pixelFormat != lc::formats::NV12 && stream.pixelFormat != lc::formats::YUYV) {
        stream.pixelFormat = lc::formats::YUV420;
      }
      // findValidColorSpace(): sYCC, SMPTE 170M and Rec. 709 pass; the driver decides
      // last.
      if (granted_) stream.colorSpace = granted_;
      stream.stride = (stream.size.width + 63) / 64 * 64;
    }
    return Adjusted;
  }

 private:
  void validate_raw(lc::StreamConfiguration& stream) {
    const unsigned asked = stream.pixelFormat == lc::formats::R8 ? 8
                           : stream.pixelFormat == kR16          ? 16
                                                                 : 10;
    const Mode* best = &modes_.front();
    for (const Mode& mode : modes_) {
      if (score(mode, stream.size, asked) < score(*best, stream.size, asked)) best = &mode;
    }
    // The requested order of colours, here none, is kept; the size and the bits are the
    // sensor's.
    if (board_ == Board::pi5) {
      stream.pixelFormat = kR16;
    } else {
      stream.pixelFormat = best->bits == 8 ? lc::formats::R8 : lc::formats::R10;
    }
    stream.size = best->size;
    stream.stride = stream.size.width * (stream.pixelFormat == lc::formats::R8 ? 1 : 2);
    stream.colorSpace = lc::ColorSpace::Raw;
  }

  /// findBestFormat()'s score: a bit costs 500 pixels.
  static unsigned long score(const Mode& mode, const lc::Size& size, unsigned bits) {
    const auto off = [](unsigned a, unsigned b) {
      return static_cast<unsigned long>(std::labs(static_cast<long>(a) - static_cast<long>(b)));
    };
    return off(mode.size.width, size.width) + off(mode.size.height, size.height) +
           500 * off(mode.bits, bits);
  }

  Board board_;
  std::vector<Mode> modes_;
  std::optional<lc::ColorSpace> granted_;
};

/// A pipeline that ignores colour spaces and has NV12 only: the virtual one (virtual.cpp:
/// VirtualCameraConfiguration::validate()).
class IgnorantCamera : public lc::CameraConfiguration {
 public:
  IgnorantCamera() {
    lc::StreamConfiguration stream;
    stream.pixelFormat = lc::formats::NV12;
    stream.size = {800, 600};
    addConfiguration(stream);
  }
  Status validate() override {
    lc::StreamConfiguration& stream = config_[0];
    stream.pixelFormat = lc::formats::NV12;
    stream.size = {800, 600};
    stream.stride = 800;
    return Adjusted;
  }
};

}  // namespace dtact::libcamera_test
