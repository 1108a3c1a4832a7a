#include "clients/calibrate/offline/drawing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace dtact::ctl {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kScale = 0.5;

}  // namespace

int text_width(const std::string& text) {
  int below = 0;
  return cv::getTextSize(text, kFont, kScale, 1, &below).width;
}

void draw_text(Picture& picture, cv::Point corner, const std::string& text,
               const cv::Scalar& colour) {
  // OpenCV wants the left end of the line that letters stand on.
  cv::putText(picture, text, corner + cv::Point(0, kTextHeight - 2), kFont, kScale, colour, 1,
              cv::LINE_AA);
}

image::Rgb8 to_image(const Picture& picture) {
  image::Rgb8 image{picture.cols, picture.rows, {}};
  image.pixels.reserve(3 * picture.total());
  for (const cv::Vec3b& pixel : picture) {
    image.pixels.insert(image.pixels.end(), {pixel[0], pixel[1], pixel[2]});
  }
  return image;
}

namespace {

const cv::Scalar kPaper(255, 255, 255);
const cv::Scalar kInk(20, 20, 20);
const cv::Scalar kUntrustedGrey(150, 150, 150);  // none of the map's colours is grey
constexpr int kMargin = 14;
constexpr int kBarWidth = 22;
constexpr int kLegendWidth = 120;
constexpr int kFooter = 46;

/// Dark blue (0) over green to yellow (255): lightness grows all the way, so the order survives a
/// print in grey.
Picture coloured(const cv::Mat1b& parts) {
  Picture picture;
  cv::applyColorMap(parts, picture, cv::COLORMAP_VIRIDIS);
  cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
  return picture;
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

Range range_of(const cli::DepthImage& depth) {
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

void draw_map(Picture picture, const cli::DepthImage& depth, const Range& range) {
  cv::Mat1b parts(depth.height, depth.width);
  cv::Mat1b untrusted(depth.height, depth.width);
  std::size_t i = 0;
  for (int y = 0; y < depth.height; ++y) {
    for (int x = 0; x < depth.width; ++x) {
      const double mm = depth.mm[i++];
      untrusted(y, x) = std::isnan(mm) ? 1 : 0;
      parts(y, x) = cv::saturate_cast<std::uint8_t>(
          std::isnan(mm) ? 0 : 255 * (mm - range.low) / (range.high - range.low));
    }
  }
  coloured(parts).copyTo(picture);
  picture.setTo(kUntrustedGrey, untrusted);
}

void draw_legend(Picture& picture, const Range& range, int left, int top, int height) {
  const cv::Mat1b parts(height, kBarWidth);
  for (int y = 0; y < height; ++y) {
    parts.row(y) = cv::saturate_cast<std::uint8_t>(255 * (1 - (y + 0.5) / height));
  }
  coloured(parts).copyTo(picture(cv::Rect(left, top, kBarWidth, height)));
  const auto steps = std::lround((range.high - range.low) / range.step);
  const int decimals = range.step < 0.0999 ? 2 : 1;
  for (long i = 0; i <= steps; ++i) {
    const double mm = range.low + static_cast<double>(i) * range.step;
    const auto y = static_cast<int>(
        std::lround(height * (1 - static_cast<double>(i) / static_cast<double>(steps))));
    picture(cv::Rect(left + kBarWidth, top + y - 1, 5, 2)).setTo(kInk);
    const std::string number = fmt::format("{:.{}f}", std::abs(mm) < 1e-9 ? 0.0 : mm, decimals);
    draw_text(picture, {left + kBarWidth + 9, top + y - kTextHeight / 2},
              i == steps ? number + " mm" : number, kInk);
  }
}

/// A bar of a round length on the surface, about a quarter of the map wide.
void draw_scale(Picture& picture, const cli::DepthImage& depth, int left, int top) {
  const double mm = round_step(depth.width * depth.mm_per_px / 2.5, 2);
  cv::rectangle(picture,
                cv::Rect(left, top, static_cast<int>(std::lround(mm / depth.mm_per_px)), 4), kInk,
                cv::FILLED);
  draw_text(picture, {left, top + 9}, fmt::format("{:g} mm", mm), kInk);
}

}  // namespace

std::string encode_colour_png(const cli::DepthImage& depth) {
  const Range range = range_of(depth);
  // A small map still leaves room for the legend's numbers.
  const int body = std::max(depth.height, 12 * kTextHeight);
  Picture picture(body + kFooter + 2 * kMargin, depth.width + kLegendWidth + 3 * kMargin);
  picture.setTo(kPaper);
  draw_map(picture(cv::Rect(kMargin, kMargin, depth.width, depth.height)), depth, range);
  draw_legend(picture, range, depth.width + 2 * kMargin, kMargin, body);
  draw_scale(picture, depth, kMargin, kMargin + body + kMargin);
  return image::encode_png(to_image(picture));
}

}  // namespace dtact::ctl
