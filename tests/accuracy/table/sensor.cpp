#include "tests/accuracy/table/sensor.hpp"

#include <algorithm>
#include <span>
#include <stdexcept>
#include <utility>

#include "tests/accuracy/table/trial.hpp"

namespace dtact::table {
namespace {

constexpr auto kPixels = std::size_t{kFrameWidth} * kFrameHeight;

}  // namespace

Sensor::Sensor(const std::shared_ptr<const hal::sim::Truth>& truth,
               const Configuration& configuration, std::uint64_t seed)
    : renderer_(truth, lit(truth->scene(), configuration), seed),
      light_(hal::sim::led_levels(light_of(configuration))),
      luma_(kFrameWidth, kFrameHeight),
      encoder_(hal::sim::Output::mjpeg, kFrameWidth, kFrameHeight),
      decoder_(kFrameWidth, kFrameHeight),
      payload_(encoder_.capacity()) {}

image::Grey8 Sensor::frame(std::uint64_t sequence) {
  renderer_.render(sequence, light_, luma_.data(), luma_.stride(), kFrameHeight);
  const std::size_t bytes = encoder_.encode(luma_.view(), payload_);
  image::Grey8 image{kFrameWidth, kFrameHeight, std::vector<std::uint8_t>(kPixels)};
  if (decoder_.decode(std::span(payload_).first(bytes), image.pixels.data(), kFrameWidth) !=
      hal::mjpeg::Status::ok) {
    throw std::runtime_error("the simulated camera's JPEG does not decode");
  }
  return image;
}

std::vector<image::Grey8> Sensor::press(std::size_t index, std::size_t count) {
  std::vector<image::Grey8> frames;
  for (std::size_t i = 0; i < count; ++i) {
    frames.push_back(frame(first_still_frame(truth(), index) + i));
  }
  return frames;
}

image::Grey16 Sensor::reference(std::size_t count) {
  std::vector<image::Grey8> frames;
  for (std::size_t i = 0; i < count; ++i) frames.push_back(frame(i));
  return mean_q8(frames);
}

image::Grey16 mean_q8(const std::vector<image::Grey8>& frames) {
  std::vector<std::uint32_t> sums(kPixels);
  for (const image::Grey8& frame : frames) {
    std::ranges::transform(sums, frame.pixels, sums.begin(),
                           [](std::uint32_t sum, std::uint8_t v) { return sum + v; });
  }
  const auto n = static_cast<std::uint32_t>(frames.size());
  image::Grey16 mean{kFrameWidth, kFrameHeight, std::vector<std::uint16_t>(kPixels)};
  std::ranges::transform(sums, mean.pixels.begin(), [n](std::uint32_t sum) {
    return static_cast<std::uint16_t>((256 * sum + n / 2) / n);
  });
  return mean;
}

image::Grey8 crop8(const image::Grey16& q8) {
  image::Grey8 crop{kCrop, kCrop, {}};
  crop.pixels.reserve(std::size_t{kCrop} * kCrop);
  for (int y = kCropRow; y < kCropRow + kCrop; ++y) {
    for (int x = kCropCol; x < kCropCol + kCrop; ++x) {
      const auto i = static_cast<std::size_t>(y) * kFrameWidth + static_cast<std::size_t>(x);
      crop.pixels.push_back(static_cast<std::uint8_t>(std::min(255, (q8.pixels[i] + 128) / 256)));
    }
  }
  return crop;
}

}  // namespace dtact::table
