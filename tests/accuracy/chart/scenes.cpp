#include "tests/accuracy/chart/scenes.hpp"

#include <algorithm>

#include "hal/sim/scene.hpp"

namespace dtact::chart {
namespace {

constexpr std::uint64_t kSeed = 7;
constexpr std::uint64_t kAtRest = 60;  // frame; presses rest from 0.5 s on
constexpr int kReferenceFrames = 64;
constexpr int kShotFrames = 8;

template <typename Pixel>
std::vector<Pixel> crop(const std::vector<Pixel>& frame) {
  std::vector<Pixel> out;
  out.reserve(std::size_t{kSide} * kSide);
  for (int y = 0; y < kSide; ++y) {
    const auto row = frame.begin() + std::ptrdiff_t{y + kCropRow} * kWidth + kCropCol;
    out.insert(out.end(), row, row + kSide);
  }
  return out;
}

image::Grey8 render(hal::sim::Renderer& renderer, std::uint64_t sequence) {
  image::Grey8 frame{kWidth, kHeight, std::vector<std::uint8_t>(std::size_t{kWidth} * kHeight)};
  renderer.render(sequence, hal::sim::led_levels(hal::Light{}), frame.pixels.data(), kWidth,
                  kHeight);
  return frame;
}

std::string press(const std::string& object, const std::string& place, double depth_mm) {
  return "[[press]]\nobject = " + object + "\nkeys = [ { t = 0.1, " + place +
         ", depth = 0.0 }, { t = 0.5, depth = " + std::to_string(depth_mm) + " } ]\n";
}

}  // namespace

Shot truth_of(const hal::sim::Renderer& renderer, std::uint64_t sequence) {
  Shot shot;
  std::vector<float> truth;
  renderer.truth().indentation_mm(sequence, truth);
  shot.truth_mm = crop(truth);
  std::vector<std::uint8_t> contact;
  renderer.truth().contact(sequence, contact);
  shot.judged = crop(contact);
  return shot;
}

Shot shoot(const std::string& name, const std::string& press_toml, int frames) {
  const hal::sim::Scene scene = hal::sim::parse_scene(press_toml, name);
  hal::sim::Renderer renderer(scene, kSeed);
  Shot shot = truth_of(renderer, kAtRest);
  shot.name = name;
  for (int i = 0; i < frames; ++i) {
    shot.frames.push_back(render(renderer, kAtRest + static_cast<std::uint64_t>(i)));
  }
  if (press_toml.empty()) std::ranges::fill(shot.judged, std::uint8_t{255});
  return shot;
}

image::Grey16 make_reference() {
  const hal::sim::Scene scene = hal::sim::parse_scene("", "no contact");
  hal::sim::Renderer renderer(scene, kSeed + 1);
  std::vector<std::uint32_t> sum(std::size_t{kWidth} * kHeight);
  for (std::uint64_t i = 0; i < kReferenceFrames; ++i) {
    const image::Grey8 frame = render(renderer, i);
    for (std::size_t p = 0; p < sum.size(); ++p) sum[p] += frame.pixels[p];
  }
  image::Grey16 mean{kWidth, kHeight, std::vector<std::uint16_t>(sum.size())};
  std::ranges::transform(sum, mean.pixels.begin(), [](std::uint32_t s) {
    return static_cast<std::uint16_t>((s * 256 + kReferenceFrames / 2) / kReferenceFrames);
  });
  return mean;
}

Shot make_calibration_press() {
  return shoot("calibration", press("\"ball\"\nradius_mm = 4.0", "x = 0.8, y = -0.5", 1.3), 32);
}

std::vector<Shot> make_calibration_presses() {
  std::vector<Shot> shots;
  for (int i = 0; i < 11; ++i) {
    const std::string place = "x = " + std::to_string(i * 7 % 11 - 5) +
                              ".0, y = " + std::to_string(i * 4 % 11 - 5) + ".0";
    shots.push_back(shoot("press " + std::to_string(i + 1),
                          press("\"ball\"\nradius_mm = 4.0", place, 0.4 + 0.1 * i), kShotFrames));
  }
  return shots;
}

std::vector<Shot> make_shots() {
  std::vector<Shot> shots;
  shots.push_back(
      shoot("ball", press("\"ball\"\nradius_mm = 5.0", "x = -1.5, y = 1.0", 1.2), kShotFrames));
  shots.push_back(
      shoot("screws", press("\"three_set_screws\"", "x = 0.5, y = -0.5", 0.8), kShotFrames));
  shots.push_back(
      shoot("flat", press("\"disc\"\nradius_mm = 10.0", "x = 0.0, y = 0.0", 0.25), kShotFrames));
  shots.push_back(shoot("nothing", "", kShotFrames));
  return shots;
}

}  // namespace dtact::chart
