#include "tests/accuracy/sim/ball_profile.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "hal/sim/renderer.hpp"

namespace dtact::accuracy {
namespace {

constexpr int kFrames = 10;
constexpr std::size_t kRings = 45;

Image to_image(const image::Grey8& grey) {
  return {grey.width, grey.height, {grey.pixels.begin(), grey.pixels.end()}};
}

Image mean_frame(hal::sim::Renderer& renderer, std::uint64_t first) {
  const auto& camera = renderer.truth().scene().camera;
  image::Grey8 frame{camera.width, camera.height, {}};
  frame.pixels.resize(static_cast<std::size_t>(camera.width) *
                      static_cast<std::size_t>(camera.height));
  Image mean{frame.width, frame.height, std::vector<double>(frame.pixels.size())};
  for (std::uint64_t n = first; n < first + kFrames; ++n) {
    renderer.render(n, hal::sim::led_levels({}), frame.pixels.data(), frame.width, frame.height);
    for (std::size_t i = 0; i < frame.pixels.size(); ++i) mean.pixels[i] += frame.pixels[i];
  }
  for (double& pixel : mean.pixels) pixel = std::round(pixel / kFrames);
  return mean;
}

}  // namespace

BallPress read_real(const std::filesystem::path& folder) {
  return {to_image(image::read_png_grey8(folder / "ball_reference.png")),
          to_image(image::read_png_grey8(folder / "ball.png"))};
}

BallPress simulate(const hal::sim::Scene& scene) {
  hal::sim::Renderer renderer(scene, 1);
  BallPress press;
  press.reference = mean_frame(renderer, 0);
  press.ball = mean_frame(renderer, static_cast<std::uint64_t>(3 * scene.camera.fps));
  return press;
}

Image simulate_frame(const hal::sim::Scene& scene) {
  return to_image(hal::sim::render_frame(scene, 0, {}, 1));
}

Image change_of(const BallPress& press) {
  Image change = press.reference;
  for (std::size_t i = 0; i < change.pixels.size(); ++i) change.pixels[i] -= press.ball.pixels[i];
  return change;
}

Centre centroid(const BallPress& press) {
  const Image change = change_of(press);
  double sum = 0;
  Centre centre;
  for (int y = 0; y < change.height; ++y) {
    for (int x = 0; x < change.width; ++x) {
      const double value = change.pixels[change.index(x, y)];
      const double weight = std::max(value - 5, 0.0);
      sum += weight;
      centre.x += weight * x;
      centre.y += weight * y;
    }
  }
  if (sum <= 0) throw std::runtime_error("nothing is darker in the ball's image");
  return {centre.x / sum, centre.y / sum};
}

Profile radial_profile(const Image& change, const Centre& centre, double mm_per_px) {
  std::vector<double> sums(kRings);
  std::vector<double> counts(kRings);
  for (int y = 0; y < change.height; ++y) {
    for (int x = 0; x < change.width; ++x) {
      const double r = std::hypot(x - centre.x, y - centre.y) * mm_per_px;
      const auto ring = static_cast<std::size_t>(r / Profile::kStep_mm);
      if (ring >= kRings) continue;
      sums[ring] += change.pixels[change.index(x, y)];
      counts[ring] += 1;
    }
  }
  Profile profile;
  for (std::size_t i = 0; i < kRings; ++i) profile.change.push_back(sums[i] / counts[i]);
  const auto& c = profile.change;
  for (std::size_t i = 1; i < kRings; ++i) {
    if (c[i - 1] > 0 && c[i] <= 0) {
      profile.zero_mm =
          Profile::radius_mm(i - 1) + Profile::kStep_mm * c[i - 1] / (c[i - 1] - c[i]);
      break;
    }
  }
  // The minimum of the parabola through the lowest ring and its neighbours.
  const auto lowest =
      static_cast<std::size_t>(std::min_element(c.begin() + 1, c.end() - 1) - c.begin());
  const double before = c[lowest - 1] - c[lowest];
  const double after = c[lowest + 1] - c[lowest];
  const double shift = (before - after) / (before + after) / 2;
  profile.ring_mm = Profile::radius_mm(lowest) + shift * Profile::kStep_mm;
  profile.ring = c[lowest] - (before + after) * shift * shift / 2;
  return profile;
}

double rms_difference(const Profile& a, const Profile& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.change.size(); ++i) {
    sum += (a.change[i] - b.change[i]) * (a.change[i] - b.change[i]);
  }
  return std::sqrt(sum / static_cast<double>(a.change.size()));
}

double high_pass_noise(const Image& image) {
  constexpr int kRadius = 7;
  constexpr int kBorder = 20;
  std::vector<double> taps;
  double total = 0;
  for (int k = -kRadius; k <= kRadius; ++k) {
    taps.push_back(std::exp(-k * k / 8.0));
    total += taps.back();
  }
  const auto at = [&](const std::vector<double>& plane, int x, int y) {
    return plane[image.index(x, y)];
  };
  std::vector<double> rows(image.pixels.size());
  for (int y = 0; y < image.height; ++y) {
    for (int x = kRadius; x < image.width - kRadius; ++x) {
      double sum = 0;
      int source = x - kRadius;
      for (const double tap : taps) sum += tap * at(image.pixels, source++, y);
      rows[image.index(x, y)] = sum / total;
    }
  }
  double sum = 0;
  double squares = 0;
  double count = 0;
  for (int y = kBorder; y < image.height - kBorder; ++y) {
    for (int x = kBorder; x < image.width - kBorder; ++x) {
      double blurred = 0;
      int source = y - kRadius;
      for (const double tap : taps) blurred += tap * at(rows, x, source++);
      const double rest = at(image.pixels, x, y) - blurred / total;
      sum += rest;
      squares += rest * rest;
      count += 1;
    }
  }
  return std::sqrt(squares / count - sum / count * (sum / count));
}

}  // namespace dtact::accuracy
