#include "daemon/pipeline/layer_marks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <numbers>
#include <utility>

namespace dtact::pipeline {
namespace {

constexpr int kReach = LayerMarks::kReach;
constexpr int kSide = 2 * kReach + 1;
/// Turns that are tried: out to five degrees, at the corner of a map of 580 pixels two pixels
/// apart.
constexpr double kTurnStepDeg = 0.25;
constexpr int kTurns = 20;
/// Within a patch a turn of some degrees is a shift.
constexpr int kPatch = 64;  // pixels, about

struct Plane {
  int width;
  int height;
  std::vector<float> values;

  float* row(int y) { return values.data() + std::ptrdiff_t{y} * width; }
  [[nodiscard]] const float* row(int y) const { return values.data() + std::ptrdiff_t{y} * width; }
};

/// Gaussian; beyond the edge the outermost pixel stands.
Plane blurred(const Plane& in, double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<float> taps;
  float sum = 0;
  for (int k = -reach; k <= reach; ++k) {
    taps.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
    sum += taps.back();
  }
  for (float& tap : taps) tap /= sum;

  Plane down{in.width, in.height, std::vector<float>(in.values.size())};
  for (int y = 0; y < in.height; ++y) {
    float* const out = down.row(y);
    for (int k = -reach; k <= reach; ++k) {
      const float* const from = in.row(std::clamp(y + k, 0, in.height - 1));
      const float tap = taps[static_cast<std::size_t>(k + reach)];
      for (int x = 0; x < in.width; ++x) out[x] += tap * from[x];
    }
  }
  Plane across{in.width, in.height, std::vector<float>(in.values.size())};
  std::vector<float> line(static_cast<std::size_t>(in.width + 2 * reach));
  for (int y = 0; y < in.height; ++y) {
    const float* const from = down.row(y);
    for (int x = -reach; x < in.width + reach; ++x) {
      line[static_cast<std::size_t>(x + reach)] = from[std::clamp(x, 0, in.width - 1)];
    }
    float* const out = across.row(y);
    for (std::size_t k = 0; k < taps.size(); ++k) {
      for (int x = 0; x < in.width; ++x) out[x] += taps[k] * line[static_cast<std::size_t>(x) + k];
    }
  }
  return across;
}

float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// What a row or a column has in common is a stripe of the camera's.
void remove_stripes(Plane& plane) {
  std::vector<float> line(static_cast<std::size_t>(plane.height));
  for (int x = 0; x < plane.width; ++x) {
    for (int y = 0; y < plane.height; ++y) line[static_cast<std::size_t>(y)] = plane.row(y)[x];
    const float common = median(line);
    for (int y = 0; y < plane.height; ++y) plane.row(y)[x] -= common;
  }
  for (int y = 0; y < plane.height; ++y) {
    line.assign(plane.row(y), plane.row(y) + plane.width);
    const float common = median(line);
    for (int x = 0; x < plane.width; ++x) plane.row(y)[x] -= common;
  }
}

/// A standard deviation that odd values do not pull; sorts some of them.
template <typename T>
T robust_deviation(std::vector<T> values) {
  for (T& value : values) value = std::abs(value);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return static_cast<T>(1.4826) * *middle;
}

std::int64_t product(const std::int16_t* a, const std::int16_t* b, int n) {
  std::int32_t sum = 0;  // a row: 4096 · 127² fits
  for (int i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

/// Correlation of a patch at each displacement, and where its middle lies from that of the part.
struct Patch {
  double x = 0;
  double y = 0;
  std::vector<double> correlation = std::vector<double>(std::size_t{kSide} * kSide);

  [[nodiscard]] double at(int dx, int dy) const {
    return correlation[static_cast<std::size_t>((dy + kReach) * kSide + dx + kReach)];
  }
};

/// A movement of the whole part: by a vector, and about its middle.
struct Movement {
  int x = 0;
  int y = 0;
  double turn_rad = 0;
};

/// What the patches' correlations say for a movement and not for its opposite; 0 where it takes too
/// many of them out of reach. `apart`: mean length of the patches' displacements.
double excess(const std::vector<Patch>& patches, const Movement& movement, double& apart) {
  const double turned = std::cos(movement.turn_rad) - 1;
  const double sine = std::sin(movement.turn_rad);
  double sum = 0;
  int within = 0;
  apart = 0;
  for (const Patch& patch : patches) {
    const auto dx = static_cast<int>(std::lround(movement.x + turned * patch.x - sine * patch.y));
    const auto dy = static_cast<int>(std::lround(movement.y + turned * patch.y + sine * patch.x));
    if (std::abs(dx) > kReach || std::abs(dy) > kReach) continue;
    sum += patch.at(dx, dy) - patch.at(-dx, -dy);
    apart += std::hypot(dx, dy);
    ++within;
  }
  if (2 * within < static_cast<int>(patches.size())) return 0;
  apart /= within;
  // As uncertain as the sum over all of them is.
  return sum * std::sqrt(static_cast<double>(patches.size()) / within);
}

/// The movement that stands out most against its opposite.
std::optional<LayerMarks::Move> one_sided(const std::vector<Patch>& patches) {
  std::vector<double> all;
  LayerMarks::Move best;
  double most = 0;
  double best_apart = 0;
  for (int step = 0; step <= 2 * kTurns; ++step) {  // 0, 1, −1, 2, …: of equals the least turn
    const double turn_deg = (step % 2 == 0 ? -1 : 1) * ((step + 1) / 2) * kTurnStepDeg;
    for (int y = -kReach; y <= kReach; ++y) {
      for (int x = -kReach; x <= kReach; ++x) {
        double apart = 0;
        const double value = excess(patches, {x, y, turn_deg * std::numbers::pi / 180}, apart);
        if (apart < LayerMarks::kLeast) continue;
        all.push_back(value);
        if (value > most) {
          most = value;
          best_apart = apart;
          best = {x, y, turn_deg, 0};
        }
      }
    }
  }
  const double noise = robust_deviation(std::move(all));
  if (noise <= 0) return std::nullopt;
  best.strength = most / noise;
  // So near to the middle a fraction of a pixel stands out too, and nearly all has to have moved.
  constexpr double kNear = 4;
  double still = 0;
  for (const Patch& patch : patches) still += patch.at(0, 0);
  if (best_apart < kNear && most < 0.5 * still) return std::nullopt;
  if (best.strength < LayerMarks::kSure) return std::nullopt;
  return best;
}

}  // namespace

LayerMarks::LayerMarks(std::span<const std::uint16_t> reference_q8, int frame_width,
                       const recon::FrameRegion& part)
    : width_(part.width),
      height_(part.height),
      detail_(static_cast<std::size_t>(part.width) * static_cast<std::size_t>(part.height)) {
  if (detail_.empty()) return;
  Plane grey{width_, height_, {}};
  grey.values.reserve(detail_.size());
  for (int y = 0; y < height_; ++y) {
    const std::uint16_t* const row =
        reference_q8.data() + std::ptrdiff_t{part.y + y} * frame_width + part.x;
    grey.values.insert(grey.values.end(), row, row + width_);
  }
  const double unit = std::max(1.0, frame_width / 640.0);
  Plane fine = blurred(grey, unit);
  const Plane wide = blurred(grey, 4 * unit);
  for (std::size_t i = 0; i < detail_.size(); ++i) fine.values[i] -= wide.values[i];
  remove_stripes(fine);
  const float deviation = robust_deviation(fine.values);
  const float scale = deviation > 0 ? 127 / (4 * deviation) : 0;
  for (std::size_t i = 0; i < detail_.size(); ++i) {
    detail_[i] =
        static_cast<std::int16_t>(std::lround(std::clamp(scale * fine.values[i], -127.0F, 127.0F)));
  }
}

std::optional<LayerMarks::Move> LayerMarks::moved_to(const LayerMarks& now) const {
  if (now.width_ != width_ || now.height_ != height_) return std::nullopt;
  if (width_ < 4 * kReach || height_ < 4 * kReach) return std::nullopt;
  const int columns = std::max(2, width_ / kPatch);
  const int rows = std::max(2, height_ / kPatch);
  std::vector<Patch> patches;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int left = column * width_ / columns;
      const int right = (column + 1) * width_ / columns;
      const int top = row * height_ / rows;
      const int bottom = (row + 1) * height_ / rows;
      Patch patch{0.5 * (left + right - width_), 0.5 * (top + bottom - height_)};
      double* out = patch.correlation.data();
      for (int dy = -kReach; dy <= kReach; ++dy) {
        for (int dx = -kReach; dx <= kReach; ++dx) {
          // Over all that both have of the patch: then a still sensor is the same either way.
          const int first = std::max(left, left - dx);
          const int n = right - left - std::abs(dx);
          std::int64_t sum = 0;
          for (int y = std::max(top, top - dy); y < std::min(bottom, bottom - dy); ++y) {
            sum += product(detail_.data() + std::ptrdiff_t{y} * width_ + first,
                           now.detail_.data() + std::ptrdiff_t{y + dy} * width_ + first + dx, n);
          }
          *out++ = static_cast<double>(sum);
        }
      }
      patches.push_back(std::move(patch));
    }
  }
  return one_sided(patches);
}

}  // namespace dtact::pipeline
