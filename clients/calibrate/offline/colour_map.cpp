#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "clients/calibrate/offline/depth_file.hpp"
#include "clients/calibrate/offline/drawing.hpp"

namespace dtact::ctl {
namespace {

constexpr Colour kPaper{255, 255, 255};
constexpr Colour kInk{20, 20, 20};
constexpr Colour kUntrustedGrey{150, 150, 150};  // none of the map's colours is grey
constexpr int kMargin = 14;
constexpr int kBarWidth = 22;
constexpr int kLegendWidth = 120;
constexpr int kFooter = 46;

/// Dark blue (low) over green to yellow (high): lightness grows all the way, so the order survives
/// a print in grey. Nine points of matplotlib's viridis (CC0).
Colour colour_of(double part) {
  constexpr std::array<Colour, 9> kPoints{{{68, 1, 84},
                                           {71, 44, 122},
                                           {59, 81, 139},
                                           {44, 113, 142},
                                           {33, 144, 141},
                                           {39, 173, 129},
                                           {92, 200, 99},
                                           {170, 220, 50},
                                           {253, 231, 37}}};
  const double place = std::clamp(part, 0.0, 1.0) * (kPoints.size() - 1);
  const auto low = std::min(static_cast<std::size_t>(place), kPoints.size() - 2);
  Colour colour{};
  for (std::size_t i = 0; i < colour.size(); ++i) {
    colour[i] = static_cast<std::uint8_t>(std::lround(
        std::lerp(kPoints[low][i], kPoints[low + 1][i], place - static_cast<double>(low))));
  }
  return colour;
}

/// The round step (1, 2 or 5 times a power of ten) that makes at most `most` steps in `span`.
double round_step(double span, double most) {
  const double least = span / most;
  const double decade = std::pow(10, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= least * (1 - 1e-9)) return factor * decade;
  }
  return 10 * decade;
}

/// Whole steps around the depths, always with zero and at least 0.1 mm.
struct Range {
  double low = 0;
  double high = 0;
  double step = 0;
};

Range range_of(const DepthImage& depth) {
  double low = 0;
  double high = 0.1;
  for (const float mm : depth.mm) {
    if (std::isnan(mm)) continue;
    low = std::min<double>(low, mm);
    high = std::max<double>(high, mm);
  }
  const double step = round_step(high - low, 8);
  return {step * std::floor(low / step), step * std::ceil(high / step), step};
}

void draw_legend(image::Rgb8& image, const Range& range, int left, int top, int height) {
  for (int y = 0; y < height; ++y) {
    fill(image, left, top + y, kBarWidth, 1, colour_of(1 - (y + 0.5) / height));
  }
  const auto steps = std::lround((range.high - range.low) / range.step);
  const int decimals = range.step < 0.0999 ? 2 : 1;
  for (long i = 0; i <= steps; ++i) {
    const double mm = range.low + static_cast<double>(i) * range.step;
    const auto y = static_cast<int>(
        std::lround(height * (1 - static_cast<double>(i) / static_cast<double>(steps))));
    fill(image, left + kBarWidth, top + y - 1, 5, 2, kInk);
    const std::string number = fmt::format("{:.{}f}", std::abs(mm) < 1e-9 ? 0.0 : mm, decimals);
    draw_text(image, left + kBarWidth + 9, top + y - kTextHeight / 2,
              i == steps ? number + " mm" : number, kInk);
  }
}

/// A bar of a round length on the surface, about a quarter of the map wide.
void draw_scale(image::Rgb8& image, const DepthImage& depth, int left, int top) {
  const double mm = round_step(depth.width * depth.mm_per_px / 2.5, 2);
  fill(image, left, top, static_cast<int>(std::lround(mm / depth.mm_per_px)), 4, kInk);
  draw_text(image, left, top + 9, fmt::format("{:g} mm", mm), kInk);
}

}  // namespace

std::string encode_colour_png(const DepthImage& depth) {
  const Range range = range_of(depth);
  // A small map still leaves room for the legend's numbers.
  const int body = std::max(depth.height, 12 * kTextHeight);
  image::Rgb8 image =
      canvas(depth.width + kLegendWidth + 3 * kMargin, body + kFooter + 2 * kMargin, kPaper);
  std::size_t pixel = 0;
  for (int y = 0; y < depth.height; ++y) {
    for (int x = 0; x < depth.width; ++x) {
      const double mm = depth.mm[pixel++];
      fill(
          image, kMargin + x, kMargin + y, 1, 1,
          std::isnan(mm) ? kUntrustedGrey : colour_of((mm - range.low) / (range.high - range.low)));
    }
  }
  draw_legend(image, range, depth.width + 2 * kMargin, kMargin, body);
  draw_scale(image, depth, kMargin, kMargin + body + kMargin);
  return image::encode_png(image);
}

}  // namespace dtact::ctl
