#include "clients/calibrate/guided/preview.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "clients/calibrate/offline/drawing.hpp"

namespace dtact::ctl::guided {
namespace {

constexpr int kReferenceGrey = 200;
constexpr int kShadesPerLevel = 4;
const cv::Scalar kMark(230, 90, 0);
constexpr int kMargin = 12;
/// The first of the terminal's greys, which run from almost black to almost white.
constexpr int kFirstGrey = 232;
constexpr int kGreys = 24;

/// Mean of one of `columns` × `rows` equal parts of the picture, as a grey of the terminal.
int grey_at(const image::Grey8& picture, int columns, int rows, int column, int row) {
  const int left = column * picture.width / columns;
  const int right = (column + 1) * picture.width / columns;
  const int top = row * picture.height / rows;
  const int bottom = (row + 1) * picture.height / rows;
  int sum = 0;
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      sum += picture.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                            static_cast<std::size_t>(x)];
    }
  }
  return kFirstGrey + sum / ((right - left) * (bottom - top)) * kGreys / 256;
}

}  // namespace

image::Grey8 darkening_picture(const image::Grey8& reference, const image::Grey8& frame) {
  image::Grey8 picture{frame.width, frame.height, {}};
  picture.pixels.resize(frame.pixels.size());
  std::ranges::transform(reference.pixels, frame.pixels, picture.pixels.begin(),
                         [](std::uint8_t before, std::uint8_t now) {
                           return static_cast<std::uint8_t>(std::clamp(
                               kReferenceGrey - kShadesPerLevel * (before - now), 0, 255));
                         });
  return picture;
}

image::Rgb8 annotated(const image::Grey8& picture, double mm_per_px,
                      const std::optional<calibration::Contact>& contact) {
  Picture out(picture.height, picture.width);
  std::ranges::transform(picture.pixels, out.begin(), cv::Vec3b::all);
  if (contact) {
    const double radius = contact->radius_mm / mm_per_px;
    cv::circle(out, cv::Point2d(contact->col, contact->row), static_cast<int>(std::lround(radius)),
               kMark, 2);
    const std::string text = fmt::format("{:.1f} mm", 2 * contact->radius_mm);
    draw_text(out,
              {static_cast<int>(contact->col) - text_width(text) / 2,
               std::min(picture.height - 2 * kTextHeight,
                        static_cast<int>(contact->row + radius) + kTextHeight / 2)},
              text, kMark);
  }
  const int bar = std::min(picture.width, static_cast<int>(std::lround(5 / mm_per_px)));
  const int top = picture.height - kMargin - kTextHeight;
  cv::rectangle(out, cv::Rect(kMargin, top - 6, bar, 3), kMark, cv::FILLED);
  draw_text(out, {kMargin, top}, "5 mm", kMark);
  return to_image(out);
}

std::vector<std::string> half_blocks(const image::Grey8& picture, int columns) {
  columns = std::clamp(columns, 1, picture.width);
  const int rows = std::clamp(columns * picture.height / picture.width / 2, 1, picture.height / 2);
  std::vector<std::string> lines;
  for (int row = 0; row < rows; ++row) {
    std::string line;
    int upper = 0;
    int lower = 0;
    for (int column = 0; column < columns; ++column) {
      const int above = grey_at(picture, columns, 2 * rows, column, 2 * row);
      const int below = grey_at(picture, columns, 2 * rows, column, 2 * row + 1);
      // A colour stays until the next: most of a picture is one grey, and this travels over ssh.
      if (above != std::exchange(upper, above)) line += fmt::format("\x1b[38;5;{}m", above);
      if (below != std::exchange(lower, below)) line += fmt::format("\x1b[48;5;{}m", below);
      line += "\u2580";
    }
    lines.push_back(line + "\x1b[0m");
  }
  return lines;
}

}  // namespace dtact::ctl::guided
