#include "tests/accuracy/atlas/disturbance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <stdexcept>
#include <utility>

namespace dtact::atlas {
namespace {

constexpr double kSpeckMm = 0.2;  // radius
constexpr float kSpeckLeaves = 0.7F;

std::size_t index_of(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

}  // namespace

Place unmoved(const Shot& shot, int x, int y, int width, int height) {
  const double angle = shot.turn_deg * std::numbers::pi / 180;
  const double cx = 0.5 * (width - 1);
  const double cy = 0.5 * (height - 1);
  const double dx = x - cx - shot.shift_px;
  const double dy = y - cy - shot.shift_px;
  return {cx + std::cos(angle) * dx + std::sin(angle) * dy,
          cy + std::cos(angle) * dy - std::sin(angle) * dx};
}

Spoiler::Spoiler(const std::shared_ptr<const hal::sim::Truth>& truth, std::uint64_t seed)
    : renderer_(truth, truth->scene(), seed),
      seed_(seed),
      width_(truth->scene().camera.width),
      height_(truth->scene().camera.height),
      grey_(index_of(0, height_, width_)),
      scratch_(grey_.size()),
      frame_(grey_.size()),
      before_(grey_.size()),
      out_(width_, height_),
      decoder_(width_, height_),
      payload_(hal::sim::PayloadEncoder(hal::sim::Output::mjpeg, width_, height_).capacity()) {}

hal::LumaView Spoiler::make(const Shot& shot, std::uint64_t sequence) {
  std::swap(frame_, before_);
  light_up(shot, sequence);
  if (moved(shot)) warp(shot);
  if (shot.blur_px > 0) blur(shot.blur_px);
  expose(shot, sequence);
  if (shot.jpeg > 0) compress(shot.jpeg);
  const int kept = static_cast<int>(std::lround(height_ * (1 - shot.stale_share)));
  std::copy(before_.begin() + static_cast<std::ptrdiff_t>(index_of(0, kept, width_)), before_.end(),
            frame_.begin() + static_cast<std::ptrdiff_t>(index_of(0, kept, width_)));
  for (int y = 0; y < height_; ++y) {
    std::copy_n(frame_.data() + index_of(0, y, width_), width_, out_.row(y));
  }
  return out_.view();
}

void Spoiler::light_up(const Shot& shot, std::uint64_t sequence) {
  const auto clean = renderer_.render_clean(shot.moment, hal::sim::led_levels(shot.light));
  for (int y = 0; y < height_; ++y) {
    // Frames come at no multiple of the PWM's period, so the bands move.
    const double phase =
        2 * std::numbers::pi * (y / shot.band_rows + 0.37 * static_cast<double>(sequence));
    const double factor = shot.exposure * (1 + shot.band * std::sin(phase)) / 64;
    for (int x = 0; x < width_; ++x) {
      const std::size_t i = index_of(x, y, width_);
      const double left = 3 * x < width_ ? 1 - shot.covered : 1;
      grey_[i] = static_cast<float>(clean[i] * factor * left);
      if (shot.leak > 0) {
        grey_[i] += static_cast<float>(shot.leak * std::pow(0.1, static_cast<double>(x) / width_));
      }
    }
  }
  std::mt19937 random(7);
  const double radius = kSpeckMm / renderer_.truth().scene().camera.mm_per_px;
  const int reach = static_cast<int>(std::ceil(radius));
  for (int speck = 0; speck < shot.dust; ++speck) {
    const int cx = static_cast<int>(random() % static_cast<unsigned>(width_));
    const int cy = static_cast<int>(random() % static_cast<unsigned>(height_));
    for (int y = std::max(0, cy - reach); y <= std::min(height_ - 1, cy + reach); ++y) {
      for (int x = std::max(0, cx - reach); x <= std::min(width_ - 1, cx + reach); ++x) {
        if (std::hypot(x - cx, y - cy) <= radius) grey_[index_of(x, y, width_)] *= kSpeckLeaves;
      }
    }
  }
}

void Spoiler::warp(const Shot& shot) {
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const Place from = unmoved(shot, x, y, width_, height_);
      const double u = std::clamp(from.x, 0.0, width_ - 1.001);
      const double v = std::clamp(from.y, 0.0, height_ - 1.001);
      const int left = static_cast<int>(u);
      const int top = static_cast<int>(v);
      const auto fx = static_cast<float>(u - left);
      const auto fy = static_cast<float>(v - top);
      const std::size_t i = index_of(left, top, width_);
      const auto w = static_cast<std::size_t>(width_);
      scratch_[index_of(x, y, width_)] = std::lerp(
          std::lerp(grey_[i], grey_[i + 1], fx), std::lerp(grey_[i + w], grey_[i + w + 1], fx), fy);
    }
  }
  std::swap(grey_, scratch_);
}

void Spoiler::blur(double sigma) {
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  std::vector<float> taps;
  float sum = 0;
  for (int k = -radius; k <= radius; ++k) {
    taps.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
    sum += taps.back();
  }
  for (float& tap : taps) tap /= sum;
  const auto pass = [&](int length, int lines, std::size_t step, std::size_t line_step) {
    for (int line = 0; line < lines; ++line) {
      const std::size_t base = static_cast<std::size_t>(line) * line_step;
      for (int at = 0; at < length; ++at) {
        float value = 0;
        for (int k = -radius; k <= radius; ++k) {
          const int from = std::clamp(at + k, 0, length - 1);
          value += taps[static_cast<std::size_t>(k + radius)] *
                   grey_[base + static_cast<std::size_t>(from) * step];
        }
        scratch_[base + static_cast<std::size_t>(at) * step] = value;
      }
    }
    std::swap(grey_, scratch_);
  };
  pass(width_, height_, 1, static_cast<std::size_t>(width_));
  pass(height_, width_, static_cast<std::size_t>(width_), 1);
}

void Spoiler::expose(const Shot& shot, std::uint64_t sequence) {
  const auto& camera = renderer_.truth().scene().camera;
  // The simulator's noise ends at 4.6 grey levels: more is several draws.
  const int draws = static_cast<int>(std::ceil(shot.noise * shot.noise / 16));
  const double factor = shot.noise / std::sqrt(std::max(1, draws));
  const auto w = static_cast<std::size_t>(width_);
  std::vector<std::uint16_t> row(w);
  std::vector<std::int16_t> amplitude(w);
  for (int draw = 0; draw < std::max(1, draws); ++draw) {
    const hal::sim::Noise noise(seed_ + static_cast<std::uint64_t>(draw),
                                camera.read_noise * factor, camera.shot_noise * factor);
    for (int y = 0; y < height_; ++y) {
      const std::size_t begin = index_of(0, y, width_);
      for (std::size_t x = 0; x < w; ++x) {
        const float level = draw == 0 ? grey_[begin + x] : static_cast<float>(frame_[begin + x]);
        row[x] = static_cast<std::uint16_t>(std::lround(64 * std::clamp(level, 0.0F, 255.0F)));
      }
      noise.amplitude(row, amplitude);
      noise.add(sequence, static_cast<std::uint32_t>(y), row, amplitude, frame_.data() + begin);
    }
  }
  std::mt19937 random(11);
  for (int i = 0; i < shot.dead_pixels; ++i) frame_[random() % frame_.size()] = 0;
}

void Spoiler::compress(int quality) {
  hal::sim::PayloadEncoder encoder(hal::sim::Output::mjpeg, width_, height_, quality);
  const hal::LumaView view{frame_.data(), width_, height_, width_};
  const std::size_t bytes = encoder.encode(view, payload_);
  if (decoder_.decode(std::span(payload_).first(bytes), frame_.data(), width_) !=
      hal::mjpeg::Status::ok) {
    throw std::runtime_error("the simulated camera's JPEG does not decode");
  }
}

}  // namespace dtact::atlas
