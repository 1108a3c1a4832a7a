// A camera's JPEG payload, four bytes of crop before it. A bad frame leaves no state in the
// decoder, and a crop gives the same pixels as the whole picture, at each size that frames are
// decoded at.
#include <algorithm>
#include <array>

#include "hal/mjpeg/grey_decoder.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

using hal::mjpeg::Status;

constexpr int kWidth = 32;
constexpr int kHeight = 24;
using Picture = std::array<std::uint8_t, std::size_t{kWidth} * kHeight>;

class Decoder {
 public:
  explicit Decoder(int scale)
      : width_(kWidth / scale), height_(kHeight / scale), decoder_(kWidth, kHeight, scale) {
    require(decode(good_, expected_) == Status::ok, "the test's own picture decodes");
  }

  void try_one(std::span<const std::uint8_t, 4> place, std::span<const std::uint8_t> payload) {
    hal::Area crop{place[0] % width_, place[1] % height_, 0, 0};
    crop.width = 1 + place[2] % (width_ - crop.x);
    crop.height = 1 + place[3] % (height_ - crop.y);
    Picture whole{};
    Picture part{};
    const Status status = decode(payload, whole);
    decoder_.set_crop(crop);
    require(decode(payload, part) == status, "a crop does not change what is wrong with a frame");
    decoder_.set_crop({});
    if (status == Status::ok) {
      for (int y = crop.y; y < crop.y + crop.height; ++y) {
        const std::ptrdiff_t begin = std::ptrdiff_t{y} * width_ + crop.x;
        require(std::equal(whole.begin() + begin, whole.begin() + begin + crop.width,
                           part.begin() + begin),
                "a crop gives what the whole picture has there");
      }
    }
    require_sentence(hal::mjpeg::describe(status));
    hal::mjpeg::Size size;
    if (decoder_.read_size(payload, size) == Status::ok && status == Status::ok) {
      require(size == hal::mjpeg::Size{kWidth, kHeight}, "a frame has the size it says");
    }
    Picture after{};
    require(decode(good_, after) == Status::ok && after == expected_,
            "a frame leaves nothing behind");
  }

 private:
  Status decode(std::span<const std::uint8_t> payload, Picture& out) {
    return decoder_.decode(payload, out.data(), width_);
  }

  int width_;
  int height_;
  hal::mjpeg::GreyDecoder decoder_;
  std::vector<std::uint8_t> good_ = fakes::make_jpeg({.width = kWidth, .height = kHeight},
                                                     [](int x, int y) { return 4 * x + 3 * y; });
  Picture expected_{};
};

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact::fuzz;
  static std::array<Decoder, 3> decoders{Decoder(1), Decoder(2), Decoder(4)};
  if (size < 4) return 0;
  const std::span<const std::uint8_t> input(data, size);
  for (Decoder& decoder : decoders) decoder.try_one(input.first<4>(), input.subspan(4));
  return 0;
}
