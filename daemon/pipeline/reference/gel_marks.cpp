#include "daemon/pipeline/reference/gel_marks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <numbers>
#include <numeric>
#include <utility>

namespace dtact::pipeline {
namespace {

constexpr int kReach = GelMarks::kReach;
constexpr int kSide = 2 * kReach + 1;
/// Turns that are tried: out to five degrees, at the corner of a map of 580 pixels two pixels
/// apart.
constexpr double kTurnStepDeg = 0.25;
constexpr int kTurns = 20;
/// Within a patch a turn of some degrees is a shift.
constexpr int kPatch = 64;  // pixels, about

/// A Gaussian to either side of its middle, of sum one.
std::vector<float> gaussian(double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<float> taps;
  for (int k = -reach; k <= reach; ++k) {
    taps.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
  }
  const float sum = std::accumulate(taps.begin(), taps.end(), 0.0F);
  for (float& tap : taps) tap /= sum;
  return taps;
}

/// Blurs one row after another of a part of an image, so that no plane is needed in between. Beyond
/// the part's edge its outermost pixel stands.
class RowBlur {
 public:
  RowBlur(double sigma, int width)
      : taps_(gaussian(sigma)),
        reach_(static_cast<int>(taps_.size() / 2)),
        line_(static_cast<std::size_t>(width) + taps_.size() - 1),
        out_(static_cast<std::size_t>(width)) {}

  /// Row y of a part, blurred; valid until the next call. `part`: its upper left pixel.
  std::span<const float> row(const std::uint16_t* part, int stride, int width, int height, int y) {
    float* const line = line_.data() + reach_;
    std::fill(line, line + width, 0.0F);
    int k = -reach_;
    for (const float tap : taps_) {
      const std::uint16_t* const from =
          part + std::ptrdiff_t{std::clamp(y + k, 0, height - 1)} * stride;
      for (int x = 0; x < width; ++x) line[x] += tap * static_cast<float>(from[x]);
      ++k;
    }
    std::fill(line - reach_, line, line[0]);
    std::fill(line + width, line + width + reach_, line[width - 1]);
    std::ranges::fill(out_, 0.0F);
    const float* from = line_.data();
    for (const float tap : taps_) {
      for (std::size_t x = 0; x < out_.size(); ++x) out_[x] += tap * from[x];
      ++from;
    }
    return out_;
  }

 private:
  std::vector<float> taps_;
  int reach_;
  std::vector<float> line_;
  std::vector<float> out_;
};

template <typename T>
T median(std::vector<T>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// A standard deviation that odd values do not pull.
template <typename T>
double robust_deviation(std::vector<T>& sizes) {
  for (T& size : sizes) size = static_cast<T>(std::abs(size));
  return 1.4826 * static_cast<double>(median(sizes));
}

/// Takes off what a row or a column has in common, a stripe of the camera's: `count` values, `step`
/// apart.
void remove_stripe(std::int16_t* first, int count, std::ptrdiff_t step,
                   std::vector<std::int16_t>& line) {
  line.clear();
  for (int i = 0; i < count; ++i) line.push_back(first[i * step]);
  const std::int16_t common = median(line);
  for (int i = 0; i < count; ++i) {
    first[i * step] = static_cast<std::int16_t>(first[i * step] - common);
  }
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
  std::vector<float> correlation = std::vector<float>(std::size_t{kSide} * kSide);

  [[nodiscard]] float at(int dx, int dy) const {
    return correlation[static_cast<std::size_t>(dy + kReach) * kSide +
                       static_cast<std::size_t>(dx + kReach)];
  }
};

/// A movement of the whole part: by a vector, and about its middle.
struct Movement {
  int x = 0;
  int y = 0;
  double turn_rad = 0;
};

/// What the patches' correlations say for a movement and not for its opposite. `apart`: mean length
/// of the patches' displacements; 0 where too many of them are out of reach.
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
    sum += static_cast<double>(patch.at(dx, dy) - patch.at(-dx, -dy));
    apart += std::hypot(dx, dy);
    ++within;
  }
  if (2 * within < static_cast<int>(patches.size())) {
    apart = 0;
    return 0;
  }
  apart /= within;
  // The sum's uncertainty is that of all patches.
  return sum * std::sqrt(static_cast<double>(patches.size()) / within);
}

/// The movement that stands out most against its opposite.
std::optional<GelMarks::Move> one_sided(const std::vector<Patch>& patches) {
  std::vector<float> all;
  GelMarks::Move best;
  double most = 0;
  double best_apart = 0;
  for (int step = 0; step <= 2 * kTurns; ++step) {  // 0, 1, −1, 2, …: of equals the least turn
    const int turns = (step + 1) / 2;
    const double turn_deg = (step % 2 == 0 ? -turns : turns) * kTurnStepDeg;
    for (int y = -kReach; y <= kReach; ++y) {
      for (int x = -kReach; x <= kReach; ++x) {
        double apart = 0;
        const double value = excess(patches, {x, y, turn_deg * std::numbers::pi / 180}, apart);
        if (apart < GelMarks::kMin) continue;
        all.push_back(static_cast<float>(value));
        if (value > most) {
          most = value;
          best_apart = apart;
          best = {x, y, turn_deg, 0};
        }
      }
    }
  }
  const double noise = robust_deviation(all);
  if (noise <= 0) return std::nullopt;
  best.strength = most / noise;
  // So near to the middle a fraction of a pixel stands out too, and nearly all has to have moved.
  constexpr double kNear = 4;
  double still = 0;
  for (const Patch& patch : patches) still += static_cast<double>(patch.at(0, 0));
  if (best_apart < kNear && most < 0.5 * still) return std::nullopt;
  if (best.strength < GelMarks::kSure) return std::nullopt;
  return best;
}

}  // namespace

GelMarks::GelMarks(std::span<const std::uint16_t> reference_q8, int frame_width,
                   const recon::FrameRegion& part)
    : part_(part),
      detail_(static_cast<std::size_t>(part.width) * static_cast<std::size_t>(part.height)) {
  if (detail_.empty()) return;
  const std::uint16_t* const from =
      reference_q8.data() + std::ptrdiff_t{part.y} * frame_width + part.x;
  const double unit = std::max(1.0, frame_width / 640.0);
  RowBlur narrow(unit, part_.width);
  RowBlur wide(4 * unit, part_.width);
  for (int y = 0; y < part_.height; ++y) {
    const auto sharp = narrow.row(from, frame_width, part_.width, part_.height, y);
    const auto smooth = wide.row(from, frame_width, part_.width, part_.height, y);
    std::int16_t* const out = detail_.data() + std::ptrdiff_t{y} * part_.width;
    for (std::size_t x = 0; x < sharp.size(); ++x) {
      out[x] = static_cast<std::int16_t>(
          std::lround(std::clamp(sharp[x] - smooth[x], -10000.0F, 10000.0F)));
    }
  }
  std::vector<std::int16_t> scratch;
  for (int x = 0; x < part_.width; ++x)
    remove_stripe(detail_.data() + x, part_.height, part_.width, scratch);
  for (int y = 0; y < part_.height; ++y) {
    remove_stripe(detail_.data() + std::ptrdiff_t{y} * part_.width, part_.width, 1, scratch);
  }
  scratch.clear();  // every fifth is plenty to know the deviation by
  for (std::size_t i = 0; i < detail_.size(); i += 5) scratch.push_back(detail_[i]);
  const double deviation = robust_deviation(scratch);
  const double scale = deviation > 0 ? 127 / (4 * deviation) : 0;
  for (std::int16_t& value : detail_) {
    value = static_cast<std::int16_t>(std::lround(std::clamp(scale * value, -127.0, 127.0)));
  }
}

std::optional<GelMarks::Move> GelMarks::moved_to(const GelMarks& now) const {
  if (now.part_.width != part_.width || now.part_.height != part_.height) return std::nullopt;
  if (part_.width < 4 * kReach || part_.height < 4 * kReach) return std::nullopt;
  const int columns = std::max(2, part_.width / kPatch);
  const int rows = std::max(2, part_.height / kPatch);
  std::vector<Patch> patches;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int left = column * part_.width / columns;
      const int right = (column + 1) * part_.width / columns;
      const int top = row * part_.height / rows;
      const int bottom = (row + 1) * part_.height / rows;
      Patch patch{0.5 * (left + right - part_.width), 0.5 * (top + bottom - part_.height)};
      float* out = patch.correlation.data();
      for (int dy = -kReach; dy <= kReach; ++dy) {
        for (int dx = -kReach; dx <= kReach; ++dx) {
          // Over all that both have of the patch: then a still sensor is the same either way.
          const int first = std::max(left, left - dx);
          const int n = right - left - std::abs(dx);
          std::int64_t sum = 0;
          for (int y = std::max(top, top - dy); y < std::min(bottom, bottom - dy); ++y) {
            sum +=
                product(detail_.data() + std::ptrdiff_t{y} * part_.width + first,
                        now.detail_.data() + std::ptrdiff_t{y + dy} * part_.width + first + dx, n);
          }
          *out++ = static_cast<float>(sum);
        }
      }
      patches.push_back(std::move(patch));
    }
  }
  return one_sided(patches);
}

}  // namespace dtact::pipeline
