#include "clients/calibrate/offline/drawing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "clients/common/colours.hpp"

namespace dtact::ctl {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kScale = 0.5;
const cv::Scalar kPaper(255, 255, 255);
const cv::Scalar kInk(20, 20, 20);
constexpr int kMargin = 14;
constexpr int kBarWidth = 22;
constexpr int kLegendWidth = 120;
constexpr int kFooter = 46;

Picture::value_type pixel_of(cli::Colour colour) { return {colour.r, colour.g, colour.b}; }

void draw_map(Picture picture, const cli::DepthImage& depth, double full_mm) {
  std::size_t i = 0;
  for (cv::Vec3b& pixel : picture) {
    const float mm = depth.mm[i++];
    pixel = pixel_of(std::isnan(mm) ? cli::kUntrustedColour : cli::colour_of(mm / full_mm));
  }
}

void draw_legend(Picture& picture, double full_mm, int left, int top, int height) {
  for (int y = 0; y < height; ++y) {
    picture(cv::Rect(left, top + y, kBarWidth, 1)) =
        pixel_of(cli::colour_of(1 - (y + 0.5) / height));
  }
  constexpr int kSteps = 5;
  for (int i = 0; i <= kSteps; ++i) {
    const int y = height - height * i / kSteps;
    picture(cv::Rect(left + kBarWidth, top + y - 1, 5, 2)).setTo(kInk);
    draw_text(picture, {left + kBarWidth + 9, top + y - kTextHeight / 2},
              fmt::format("{:g}{}", full_mm * i / kSteps, i == kSteps ? " mm" : ""), kInk);
  }
}

/// A bar of a round length on the surface, about a quarter of the map wide.
void draw_scale(Picture& picture, const cli::DepthImage& depth, int left, int top) {
  const double mm = cli::round_up(depth.width * depth.mm_per_px / 5);
  cv::rectangle(picture,
                cv::Rect(left, top, static_cast<int>(std::lround(mm / depth.mm_per_px)), 4), kInk,
                cv::FILLED);
  draw_text(picture, {left, top + 9}, fmt::format("{:g} mm", mm), kInk);
}

}  // namespace

int text_width(const std::string& text) {
  int below = 0;
  return cv::getTextSize(text, kFont, kScale, 1, &below).width;
}

void draw_text(Picture& picture, cv::Point corner, const std::string& text,
               const cv::Scalar& colour) {
  // OpenCV wants the left end of the baseline.
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

std::string encode_legend_png(const cli::DepthImage& depth) {
  const double full_mm = cli::full_scale_mm(cli::deepest_mm(depth.mm));
  // A small map still leaves room for the legend's numbers.
  const int body = std::max(depth.height, 12 * kTextHeight);
  Picture picture(body + kFooter + 2 * kMargin, depth.width + kLegendWidth + 3 * kMargin);
  picture.setTo(kPaper);
  draw_map(picture(cv::Rect(kMargin, kMargin, depth.width, depth.height)), depth, full_mm);
  draw_legend(picture, full_mm, depth.width + 2 * kMargin, kMargin, body);
  draw_scale(picture, depth, kMargin, kMargin + body + kMargin);
  return image::encode_png(to_image(picture));
}

}  // namespace dtact::ctl
