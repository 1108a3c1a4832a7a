#include "tests/accuracy/study/reading.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "tests/accuracy/study/median.hpp"

namespace dtact::study {
namespace {

constexpr int kThresholdLevel = 2;  // lighting_threshold of the published configuration
constexpr int kKernel = 7;          // and its Gaussian's side, pixels
constexpr double kMinPeak = 2.5;
constexpr double kRayleigh = 0.265;
constexpr double kNoiseFactor = 3;

struct Place {
  double x_mm = 0;
  double y_mm = 0;
};

/// Calls `visit(level, place)` for each pixel of an image.
template <typename Visit>
void each_pixel(const Darkening& image, const Visit& visit) {
  std::size_t i = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x, ++i) {
      visit(static_cast<double>(image.levels[i]),
            Place{(x - 0.5 * (image.width - 1)) * image.mm_per_px,
                  (y - 0.5 * (image.height - 1)) * image.mm_per_px});
    }
  }
}

/// The area around the middle of the map that is at least `depth` deep.
FlatReading measured_patch(const cv::Mat1f& depth, double half, double mm_per_px) {
  cv::Mat1b deep;
  cv::compare(depth, half, deep, cv::CMP_GE);
  cv::Mat1i labels;
  cv::Mat1i stats;
  cv::Mat1d centroids;
  cv::connectedComponentsWithStats(deep, labels, stats, centroids);
  const int label = labels(labels.rows / 2, labels.cols / 2);
  FlatReading reading;
  if (label == 0) return reading;
  reading.diameter_mm =
      2 * std::sqrt(stats(label, cv::CC_STAT_AREA) / std::numbers::pi) * mm_per_px;
  reading.side_mm =
      0.5 * (stats(label, cv::CC_STAT_WIDTH) + stats(label, cv::CC_STAT_HEIGHT)) * mm_per_px;
  return reading;
}

struct Bin {
  double at_mm = 0;
  double mean = 0;
};

/// Standard deviation of one bin, from the differences of neighbours.
double noise_of(const std::vector<Bin>& profile) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < profile.size(); ++i) {
    steps.push_back(std::abs(profile[i].mean - profile[i - 1].mean));
  }
  return median(steps).value_or(0) / 0.6745 / std::numbers::sqrt2;
}

/// The darkening along the axis of the darkest part, empty where nothing is dark.
std::vector<Bin> profile_along_axis(const Darkening& image) {
  constexpr double kFrom = 4;  // grey levels
  constexpr double kHalfBand_mm = 0.4;
  constexpr double kHalfLength_mm = 3;
  constexpr double kBin_mm = 0.02;
  constexpr double kHalfWindow_mm = 3.93;  // 700 pixels of the study
  double sum = 0, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
  const auto in_window = [&](const Place& p) {
    return std::max(std::abs(p.x_mm), std::abs(p.y_mm)) <= kHalfWindow_mm;
  };
  each_pixel(image, [&](double level, const Place& p) {
    const double weight = level - kFrom;
    if (weight <= 0 || !in_window(p)) return;
    sum += weight;
    sx += weight * p.x_mm;
    sy += weight * p.y_mm;
    sxx += weight * p.x_mm * p.x_mm;
    syy += weight * p.y_mm * p.y_mm;
    sxy += weight * p.x_mm * p.y_mm;
  });
  if (sum <= 0) return {};
  const double cx = sx / sum;
  const double cy = sy / sum;
  const double angle =
      0.5 * std::atan2(2 * (sxy / sum - cx * cy), (sxx / sum - cx * cx) - (syy / sum - cy * cy));
  const double c = std::cos(angle);
  const double s = std::sin(angle);

  // std::lround is no constant expression. NOLINTNEXTLINE(bugprone-incorrect-roundings)
  constexpr auto kBins = static_cast<std::size_t>(2 * kHalfLength_mm / kBin_mm + 0.5);
  // A bin needs as much of the band as eight of the study's pixels.
  const double least = 8 * (kMmPerPx / image.mm_per_px) * (kMmPerPx / image.mm_per_px);
  std::vector<double> sums(kBins);
  std::vector<double> counts(kBins);
  each_pixel(image, [&](double level, const Place& p) {
    const double along = c * (p.x_mm - cx) + s * (p.y_mm - cy);
    const double across = c * (p.y_mm - cy) - s * (p.x_mm - cx);
    if (!in_window(p) || std::abs(across) > kHalfBand_mm) return;
    if (std::abs(along) >= kHalfLength_mm) return;
    const auto bin =
        std::min(static_cast<std::size_t>((along + kHalfLength_mm) / kBin_mm), kBins - 1);
    sums[bin] += level;
    counts[bin] += 1;
  });
  std::vector<Bin> profile;
  for (std::size_t i = 0; i < kBins; ++i) {
    if (counts[i] <= least) continue;
    profile.push_back(
        {(static_cast<double>(i) + 0.5) * kBin_mm - kHalfLength_mm, sums[i] / counts[i]});
  }
  return profile;
}

}  // namespace

StudyLut make_lut(std::span<const KnownPress> presses, double ball_radius_mm) {
  std::array<double, 256> sums{};
  std::array<double, 256> counts{};
  StudyLut lut;
  const double r2 = ball_radius_mm * ball_radius_mm;
  for (const KnownPress& press : presses) {
    const double edge = ball_radius_mm - press.depth_mm;  // √(R² − (2Rd − d²))
    std::vector<int> inside;
    each_pixel(*press.image, [&](double level, const Place& p) {
      const double height = std::sqrt(std::max(r2 - p.x_mm * p.x_mm - p.y_mm * p.y_mm, 0.0)) - edge;
      if (height <= 0) return;
      const auto at = static_cast<std::size_t>(level);
      sums[at] += height;
      counts[at] += 1;
      inside.push_back(static_cast<int>(level));
    });
    if (inside.empty()) continue;
    const auto percentile =
        inside.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(inside.size() - 1));
    std::ranges::nth_element(inside, percentile);
    lut.deepest_level = std::max(lut.deepest_level, *percentile);
  }
  std::size_t top = 0;
  for (std::size_t level = 0; level < counts.size(); ++level) {
    if (counts[level] > 0) top = level;
  }
  if (top <= kThresholdLevel + 1) {
    throw std::runtime_error("the presses of the ball show no more than three grey levels");
  }
  for (std::size_t level = 0; level <= top; ++level) {
    if (counts[level] > 0) {
      lut.depth_mm.push_back(sums[level] / counts[level]);
      continue;
    }
    std::size_t next = level;
    while (counts[next] == 0) ++next;
    const double after = sums[next] / counts[next];
    const double before = lut.depth_mm.empty() ? after : lut.depth_mm.back();
    lut.depth_mm.push_back(std::lerp(before, after, 1.0 / static_cast<double>(next - level + 1)));
  }
  return lut;
}

FlatReading read_flat(const Darkening& image, const StudyLut& lut) {
  cv::Mat1f levels(image.height, image.width);
  std::ranges::copy(image.levels, levels.begin());
  const cv::Size kernel(kKernel, kKernel);
  cv::GaussianBlur(levels, levels, kernel, 0);
  const int top = static_cast<int>(lut.depth_mm.size()) - 1;
  constexpr float kHair = 1e-3F;  // the blur of an even 20 is 19.9999
  cv::Mat1f depth(levels.size());
  std::transform(levels.begin(), levels.end(), depth.begin(), [&](float level) {
    const auto at = static_cast<std::size_t>(std::clamp(static_cast<int>(level + kHair), 0, top));
    return static_cast<float>(lut.depth_mm[at] - lut.depth_mm[kThresholdLevel]);
  });
  cv::GaussianBlur(depth, depth, kernel, 0);
  cv::GaussianBlur(depth, depth, kernel, 0);
  std::vector<double> middle;
  std::size_t i = 0;
  each_pixel(image, [&](double, const Place& p) {
    if (std::hypot(p.x_mm, p.y_mm) < 1) {
      middle.push_back(static_cast<double>(depth.ptr<float>()[i]));
    }
    ++i;
  });
  const double centre = median(middle).value_or(0);
  FlatReading reading = measured_patch(depth, centre / 2, image.mm_per_px);
  reading.depth_mm = centre;
  return reading;
}

bool Pillars::resolved() const noexcept {
  return peak >= kMinPeak && dip >= kRayleigh && dip > kNoiseFactor * dip_sd;
}

Pillars read_pillars(const Darkening& image, double spacing_mm) {
  constexpr double kPeakWindow_mm = 0.35;
  constexpr double kTroughWindow_mm = 0.2;
  const std::vector<Bin> profile = profile_along_axis(image);
  if (profile.empty()) return {};
  const auto peak_at = [&](double where) {
    double peak = 0;
    for (const Bin& bin : profile) {
      if (std::abs(bin.at_mm - where) <= kPeakWindow_mm) peak = std::max(peak, bin.mean);
    }
    return peak;
  };
  const double left = peak_at(-spacing_mm / 2);
  const double right = peak_at(spacing_mm / 2);
  double trough = 255;
  for (const Bin& bin : profile) {
    if (std::abs(bin.at_mm) <= kTroughWindow_mm) trough = std::min(trough, bin.mean);
  }
  Pillars pillars;
  pillars.peak = std::min(left, right);
  if (pillars.peak <= 0) return {};
  const double noise = noise_of(profile);
  pillars.dip = 1 - trough / pillars.peak;
  pillars.symmetry = pillars.peak / std::max(left, right);
  pillars.dip_sd = std::hypot(noise / pillars.peak,
                              trough * noise / (std::numbers::sqrt2 * pillars.peak * pillars.peak));
  return pillars;
}

Patch patch_above(const Darkening& image, int levels) {
  cv::Mat1b dark(image.height, image.width);
  std::ranges::transform(image.levels, dark.begin(), [&](std::uint8_t level) {
    return static_cast<std::uint8_t>(level > levels ? 255 : 0);
  });
  cv::morphologyEx(dark, dark, cv::MORPH_OPEN, cv::Mat1b::ones(5, 5));
  cv::morphologyEx(dark, dark, cv::MORPH_CLOSE, cv::Mat1b::ones(11, 11));
  cv::Mat1i labels;
  cv::Mat1i stats;
  cv::Mat1d centroids;
  const int count = cv::connectedComponentsWithStats(dark, labels, stats, centroids);
  int largest = 0;
  for (int label = 1; label < count; ++label) {
    if (largest == 0 || stats(label, cv::CC_STAT_AREA) > stats(largest, cv::CC_STAT_AREA)) {
      largest = label;
    }
  }
  if (largest == 0) return {};
  double sum = 0;
  auto level = image.levels.begin();
  for (const int label : labels) {
    if (label == largest) sum += *level;
    ++level;
  }
  const double area = stats(largest, cv::CC_STAT_AREA);
  return {std::sqrt(area / std::numbers::pi) * image.mm_per_px, sum / area};
}

}  // namespace dtact::study
