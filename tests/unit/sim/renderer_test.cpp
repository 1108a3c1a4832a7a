#include "hal/sim/renderer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "tests/unit/sim/small_scene.hpp"

namespace dtact::hal::sim {
namespace {

image::Grey8 frame(Renderer& renderer, std::uint64_t sequence, const Light& light = {}) {
  image::Grey8 image{160, 120, std::vector<std::uint8_t>(kPixels)};
  renderer.render(sequence, led_levels(light), image.pixels.data(), 160, 120);
  return image;
}

double mean_grey(const image::Grey8& image) {
  return std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0) /
         static_cast<double>(image.pixels.size());
}

// FNV-1a, 64 bits (Fowler, Noll, Vo).
std::uint64_t checksum(const image::Grey8& image) {
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (const std::uint8_t byte : image.pixels) hash = (hash ^ byte) * 0x100000001B3U;
  return hash;
}

// A sensor with fixed numbers, so that tuning the built-in one does not change the bytes.
const std::string kFixedSensor = R"(
read_noise = 0.6
[optics]
pressed_slope = 0.2
pressed_curve = 0.0
bulged_slope = 0.6
bulged_curve = 0.0
narrow_mm = 0.3
wide_mm = 1.8
narrow_weight = 0.8
[light]
level = 160.0
led_radius_mm = 13.0
led_distance_mm = 25.0
fill = 0.6
vignetting = 0.02
)";

TEST(Renderer, SameSeedSameBytesWithEveryCompiler) {
  std::string toml = kSmallSensor;
  toml.replace(toml.find("[gel]"), 5, kFixedSensor + "[gel]");
  Scene scene = parse_scene(toml + kBallPress, "fixed.toml");
  scene.gel.texture = 0.002;
  scene.gel.texture_mm = 0.3;
  // Recorded from this program; gcc 12 and clang 19 give the same.
  EXPECT_EQ(checksum(render_frame(scene, 0, {}, 1)), 3335524664780952345U);
  EXPECT_EQ(checksum(render_frame(scene, 17, {}, 1)), 15995297422001146705U);
}

TEST(Renderer, FramesDoNotDependOnTheirOrder) {
  const Scene scene = small_scene();
  Renderer renderer(scene, 5);
  const auto pressed = frame(renderer, 30);
  const auto no_contact = frame(renderer, 3);
  (void)frame(renderer, 14);
  EXPECT_EQ(frame(renderer, 30).pixels, pressed.pixels);
  EXPECT_EQ(frame(renderer, 3).pixels, no_contact.pixels);
  EXPECT_EQ(render_frame(scene, 30, {}, 5).pixels, pressed.pixels);
  EXPECT_NE(render_frame(scene, 30, {}, 6).pixels, pressed.pixels);
}

TEST(Renderer, PressDarkensAndBulgeBrightens) {
  Renderer renderer(small_scene(), 1);
  const auto before = frame(renderer, 0);
  const auto after = frame(renderer, 30);
  const auto change = [&](double radius_mm) {
    double sum = 0;
    int count = 0;
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        if (std::abs(std::hypot(x - 79.5, y - 59.5) * 0.2 - radius_mm) > 0.2) continue;
        const auto i = pixel(x, y);
        sum += before.pixels[i] - after.pixels[i];
        ++count;
      }
    }
    return sum / count;
  };
  EXPECT_GT(change(0.2), 20);
  EXPECT_LT(change(4.2), -4);
  EXPECT_NEAR(change(11), 0, 0.5);
}

TEST(Renderer, HalfTheLightIsHalfTheGrey) {
  Renderer renderer(small_scene(), 1);
  Light half;
  half.brightness = 127;
  EXPECT_NEAR(mean_grey(frame(renderer, 0, half)) / mean_grey(frame(renderer, 0)), 127.0 / 255,
              0.002);
}

TEST(Renderer, GammaActsAfterTheLight) {
  Scene scene = small_scene();
  scene.camera.gamma = 2;
  Renderer renderer(scene, 1);
  const int centre = frame(renderer, 0).pixels[60 * 160 + 80];
  EXPECT_NEAR(centre, 255 * std::sqrt(scene.light.level / 255), 5);
}

TEST(Renderer, OverexposureIsWhite) {
  Scene scene = small_scene();
  scene.camera.exposure = 4;
  Renderer renderer(scene, 1);
  EXPECT_GE(frame(renderer, 0).pixels[60 * 160 + 80], 250);
}

TEST(Renderer, RendersTheRowsAskedForAndNoMore) {
  Renderer renderer(small_scene(), 1);
  std::vector<std::uint8_t> out(24000, 7);  // 120 rows, 200 bytes apart
  renderer.render(0, led_levels({}), out.data(), 200, 60);
  EXPECT_NE(out[11800], 7);
  EXPECT_EQ(out[11960], 7);
  EXPECT_EQ(out[12000], 7);
  renderer.render(0, led_levels({}), out.data(), 200, 120);
  const auto whole = frame(renderer, 0);
  EXPECT_EQ(out[20050], whole.pixels[pixel(50, 100)]);
}

}  // namespace
}  // namespace dtact::hal::sim
