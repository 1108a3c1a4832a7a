#include "hal/sim/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace dtact::hal::sim {
namespace {

constexpr int kWhite = 255 * 64;

std::size_t pixel_count(const CameraModel& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

}  // namespace

Renderer::Renderer(const Scene& scene, std::uint64_t seed)
    : Renderer(std::make_shared<const Truth>(scene), scene, seed) {}

Renderer::Renderer(std::shared_ptr<const Truth> truth, const Scene& scene, std::uint64_t seed)
    : truth_(std::move(truth)),
      perspective_(scene.surface, truth_->grid()),
      optics_(scene.optics, truth_->grid(), scene.gel),
      field_(scene),
      noise_(seed, scene.camera.read_noise, scene.camera.shot_noise),
      indentation_(truth_->grid().size()),
      loss_(truth_->grid().size()),
      seen_loss_(truth_->grid().size()),
      loss_row_(static_cast<std::size_t>(scene.camera.width)),
      light_(pixel_count(scene.camera)),
      grey_(light_.size()),
      amplitude_(light_.size()) {
  for (int i = 0; i <= kWhite; ++i) {
    const double grey = std::pow(static_cast<double>(i) / kWhite, 1 / scene.camera.gamma);
    tone_.push_back(static_cast<std::uint16_t>(std::lround(grey * kWhite)));
  }
}

void Renderer::set_gain(double gain) noexcept {
  const auto q12 = static_cast<std::uint32_t>(std::lround(4096 * std::clamp(gain, 0.25, 4.0)));
  if (std::exchange(gain_q12_, q12) != q12) exposed_rows_ = 0;
}

void Renderer::update(std::uint64_t sequence, const LedLevels& light, int rows) noexcept {
  if (!lit_ || light != levels_) {
    levels_ = light;
    lit_ = true;
    field_.compute(light, light_);
    exposed_rows_ = 0;
  }
  if (const Truth::Moment now = truth_->moment(sequence); now != moment_) {
    moment_ = now;
    truth_->blend(now, indentation_);
    optics_.run(indentation_, loss_);
    perspective_.follow(indentation_, Truth::kPerMm);
    perspective_.read(loss_, seen_loss_);
    exposed_rows_ = 0;
  }
  expose(rows);
}

std::span<const std::uint16_t> Renderer::render_clean(std::uint64_t sequence,
                                                      const LedLevels& light) noexcept {
  update(sequence, light, truth_->scene().camera.height);
  return grey_;
}

void Renderer::render(std::uint64_t sequence, const LedLevels& light, std::uint8_t* luma,
                      std::ptrdiff_t stride, int rows) noexcept {
  update(sequence, light, rows);
  const std::size_t width = loss_row_.size();
  for (int y = 0; y < rows; ++y) {
    const std::size_t begin = static_cast<std::size_t>(y) * width;
    noise_.add(sequence, static_cast<std::uint32_t>(y), {grey_.data() + begin, width},
               {amplitude_.data() + begin, width}, luma + y * stride);
  }
}

void Renderer::expose(int rows) noexcept {
  const std::size_t width = loss_row_.size();
  for (int y = exposed_rows_; y < rows; ++y) {
    truth_->pixels().sample_row(y, seen_loss_, loss_row_);
    const std::size_t begin = static_cast<std::size_t>(y) * width;
    const std::uint16_t* const light = light_.data() + begin;
    std::uint16_t* const grey = grey_.data() + begin;
    for (std::size_t x = 0; x < width; ++x) {
      const auto kept = static_cast<std::uint32_t>(32768 - loss_row_[x]);
      const std::uint32_t lit = (((light[x] * kept) >> 15U) * gain_q12_) >> 12U;
      grey[x] = tone_[std::min<std::uint32_t>(lit, kWhite)];
    }
    noise_.amplitude({grey, width}, {amplitude_.data() + begin, width});
  }
  exposed_rows_ = std::max(exposed_rows_, rows);
}

image::Grey8 render_frame(const Scene& scene, std::uint64_t sequence, const Light& light,
                          std::uint64_t seed) {
  Renderer renderer(scene, seed);
  image::Grey8 image{scene.camera.width, scene.camera.height,
                     std::vector<std::uint8_t>(pixel_count(scene.camera))};
  renderer.render(sequence, led_levels(light), image.pixels.data(), image.width, image.height);
  return image;
}

}  // namespace dtact::hal::sim
