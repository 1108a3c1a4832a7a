#include "tests/kernel/camera/uvcfake/descriptors.hpp"

#include <initializer_list>
#include <utility>

namespace uvcfake {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// Writes little-endian fields one after another.
class Writer {
 public:
  Writer& bytes(std::initializer_list<int> values) {
    for (const int v : values) out_.push_back(static_cast<std::uint8_t>(v));
    return *this;
  }
  Writer& u16(std::uint32_t v) { return bytes({int(v & 255U), int(v >> 8U & 255U)}); }
  Writer& u32(std::uint32_t v) { return u16(v & 0xffffU).u16(v >> 16U); }
  void patch_u16(std::size_t at, std::size_t v) {
    out_[at] = static_cast<std::uint8_t>(v & 255U);
    out_[at + 1] = static_cast<std::uint8_t>(v >> 8U);
  }
  [[nodiscard]] std::size_t size() const { return out_.size(); }
  [[nodiscard]] Bytes take() { return std::move(out_); }

 private:
  Bytes out_;
};

constexpr int kClassInterface = 0x24;
constexpr int kColourMatching = 13;

void frame_descriptors(Writer& w, int subtype) {
  for (std::size_t i = 0; i < kSizes.size(); ++i) {
    const std::uint32_t bytes = kSizes[i].width * kSizes[i].height * 2U;
    w.bytes({26 + 4 * int(kIntervals.size()), kClassInterface, subtype, int(i) + 1, 0});
    w.u16(kSizes[i].width).u16(kSizes[i].height);
    w.u32(bytes * 8 * 15).u32(bytes * 8 * 60).u32(bytes).u32(kIntervals[0]);
    w.bytes({int(kIntervals.size())});
    for (const std::uint32_t interval : kIntervals) w.u32(interval);
  }
  w.bytes({6, kClassInterface, kColourMatching, 1, 1, 4});
}

void control_interface(Writer& w) {
  w.bytes({9, 4, 0, 0, 0, 14, 1, 0, 2});
  w.bytes({13, kClassInterface, 1}).u16(0x0100).u16(13 + 18 + 11 + 9).u32(48'000'000);
  w.bytes({1, 1});
  // Camera terminal. Bits 1 exposure mode, 2 exposure priority, 3 exposure time, 5 focus, 17
  // automatic focus.
  w.bytes({18, kClassInterface, 2, kCameraTerminal}).u16(0x0201);
  w.bytes({0, 0, 0, 0, 0, 0, 0, 0, 3, 0x2e, 0x00, 0x02});
  // Processing unit. Bits 0 brightness, 1 contrast, 3 saturation, 4 sharpness, 5 gamma, 6 white
  // balance, 8 backlight, 9 gain, 10 power line, 12 automatic white balance.
  w.bytes({11, kClassInterface, 5, kProcessingUnit, kCameraTerminal, 0, 0, 2, 0x7b, 0x17, 0});
  w.bytes({9, kClassInterface, 3, 3}).u16(0x0101).bytes({0, kProcessingUnit, 0});
}

}  // namespace

Bytes device_descriptor() {
  Writer w;
  w.bytes({18, 1}).u16(0x0200).bytes({0xef, 2, 1, 64});
  w.u16(0x1d6b).u16(0x0102).u16(0x0100).bytes({1, 2, 3, 1});
  return w.take();
}

Bytes configuration_descriptor(bool isochronous) {
  Writer w;
  w.bytes({9, 2, 0, 0, 2, 1, 0, 0x80, 250});
  w.bytes({8, 11, 0, 2, 14, 3, 0, 2});
  control_interface(w);

  w.bytes({9, 4, 1, 0, isochronous ? 0 : 1, 14, 2, 0, 0});
  const std::size_t streaming = w.size();
  w.bytes({15, kClassInterface, 1, 2}).u16(0).bytes({0x81, 0, 3, 0, 0, 0, 1, 0, 0});
  w.bytes({11, kClassInterface, 6, kMjpeg, int(kSizes.size()), 1, 1, 0, 0, 0, 0});
  frame_descriptors(w, 7);
  w.bytes({27,
           kClassInterface,
           4,
           kYuyv,
           int(kSizes.size()),
           'Y',
           'U',
           'Y',
           '2',
           0,
           0,
           0x10,
           0,
           0x80,
           0,
           0,
           0xaa,
           0,
           0x38,
           0x9b,
           0x71,
           16,
           1,
           0,
           0,
           0,
           0});
  frame_descriptors(w, 5);
  w.patch_u16(streaming + 4, w.size() - streaming);

  if (isochronous) {
    w.bytes({9, 4, 1, 1, 1, 14, 2, 0, 0});
    w.bytes({7, 5, 0x81, 5}).u16(0x1400).bytes({1});  // 3 × 1024 bytes a microframe
  } else {
    w.bytes({7, 5, 0x81, 2}).u16(512).bytes({0});
  }
  w.patch_u16(2, w.size());
  return w.take();
}

Bytes string_descriptor(int index, const std::string& serial) {
  if (index == 0) return {4, 3, 0x09, 0x04};  // English
  if (index > 3) return {};
  const std::string text = index == 1 ? "Test" : index == 2 ? "Fake UVC camera" : serial;
  Writer w;
  w.bytes({2 + 2 * int(text.size()), 3});
  for (const char c : text) w.bytes({c, 0});
  return w.take();
}

}  // namespace uvcfake
