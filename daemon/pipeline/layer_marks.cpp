#include "daemon/pipeline/layer_marks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>

namespace dtact::pipeline {
namespace {

constexpr int kSide = 2 * LayerMarks::kReach + 1;
/// Correlation at each displacement, row-major from (−kReach, −kReach).
using Correlation = std::array<double, std::size_t{kSide} * kSide>;

constexpr std::size_t at(int x, int y) {
  return static_cast<std::size_t>(y + LayerMarks::kReach) * kSide +
         static_cast<std::size_t>(x + LayerMarks::kReach);
}

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

/// Looks for what stands out in the difference between a displacement and its opposite.
std::optional<LayerMarks::Shift> one_sided(const Correlation& correlation) {
  constexpr int kReach = LayerMarks::kReach;
  const auto excess = [&correlation](int x, int y) {
    return correlation[at(x, y)] - correlation[at(-x, -y)];
  };
  std::vector<double> all;
  LayerMarks::Shift best;
  double most = 0;
  for (int y = -kReach; y <= kReach; ++y) {
    for (int x = -kReach; x <= kReach; ++x) {
      if (x * x + y * y < LayerMarks::kLeast * LayerMarks::kLeast) continue;
      all.push_back(excess(x, y));
      if (all.back() > most) {
        most = all.back();
        best = {x, y, 0};
      }
    }
  }
  const double noise = robust_deviation(std::move(all));
  if (noise <= 0) return std::nullopt;
  best.strength = most / noise;
  // So near to the middle a fraction of a pixel stands out too, and nearly all has to have moved.
  constexpr int kNear = 4;
  const bool is_near = best.x * best.x + best.y * best.y < kNear * kNear;
  if (is_near && most < 0.5 * correlation[at(0, 0)]) return std::nullopt;
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

std::optional<LayerMarks::Shift> LayerMarks::moved_to(const LayerMarks& now) const {
  if (now.width_ != width_ || now.height_ != height_) return std::nullopt;
  if (width_ < 4 * kReach || height_ < 4 * kReach) return std::nullopt;
  std::array<Correlation, 4> quarters{};
  const std::array<int, 3> columns = {0, width_ / 2, width_};
  const std::array<int, 3> rows = {0, height_ / 2, height_};
  for (std::size_t quarter = 0; quarter < 4; ++quarter) {
    const int left = columns[quarter % 2];
    const int right = columns[quarter % 2 + 1];
    const int top = rows[quarter / 2];
    const int bottom = rows[quarter / 2 + 1];
    for (int dy = -kReach; dy <= kReach; ++dy) {
      for (int dx = -kReach; dx <= kReach; ++dx) {
        // Over all that both have of the quarter: then a still sensor is the same either way.
        const int first = std::max(left, left - dx);
        const int n = right - left - std::abs(dx);
        std::int64_t sum = 0;
        for (int y = std::max(top, top - dy); y < std::min(bottom, bottom - dy); ++y) {
          sum += product(detail_.data() + std::ptrdiff_t{y} * width_ + first,
                         now.detail_.data() + std::ptrdiff_t{y + dy} * width_ + first + dx, n);
        }
        quarters[quarter][at(dx, dy)] = static_cast<double>(sum);
      }
    }
  }
  Correlation whole{};
  for (const Correlation& quarter : quarters) {
    for (std::size_t i = 0; i < whole.size(); ++i) whole[i] += quarter[i];
  }
  std::optional<Shift> surest = one_sided(whole);
  for (const Correlation& quarter : quarters) {
    const auto shift = one_sided(quarter);
    if (shift && (!surest || shift->strength > surest->strength)) surest = shift;
  }
  return surest;
}

}  // namespace dtact::pipeline
