#include "clients/ctl/depth_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "clients/cpp/maps.hpp"

namespace dtact::ctl {
namespace {

constexpr int kColours = 20;       // columns of the legend
constexpr int kDepthColumns = 12;  // " 0.2 mm deep"

/// The nearest of xterm's 6 × 6 × 6 colours: levels 0, 95, 135, … 255.
int nearest_of_256(Colour colour) {
  const auto level = [](int value) { return value < 48 ? 0 : value < 115 ? 1 : (value - 35) / 40; };
  return 16 + 36 * level(colour.r) + 6 * level(colour.g) + level(colour.b);
}

/// Writes lines with colours; each colour only where it changes.
class Pen {
 public:
  explicit Pen(Palette palette) : palette_(palette) {}

  void put(std::string_view text, Colour ink, Colour paper) {
    if (ink != ink_) line_ += code(38, ink);
    if (paper != paper_) line_ += code(48, paper);
    ink_ = ink;
    paper_ = paper;
    line_ += text;
  }
  /// The line so far, back in the terminal's own colours, with `rest` behind it.
  std::string finish(const std::string& rest = "") {
    if (ink_.has_value()) line_ += "\x1b[0m";
    ink_.reset();
    paper_.reset();
    return std::exchange(line_, {}) + rest;
  }

 private:
  [[nodiscard]] std::string code(int what, Colour c) const {
    if (palette_ == Palette::rgb) return fmt::format("\x1b[{};2;{};{};{}m", what, c.r, c.g, c.b);
    return fmt::format("\x1b[{};5;{}m", what, nearest_of_256(c));
  }

  Palette palette_;
  std::string line_;
  std::optional<Colour> ink_;
  std::optional<Colour> paper_;
};

/// A depth map brought to the canvas: `step` of its pixels are one of ours.
class Pixels {
 public:
  Pixels(const v1::DepthMap& map, int columns, int rows)
      : mm_(client::millimetres_of(map)),
        map_width_(static_cast<int>(map.width())),
        map_height_(static_cast<int>(map.height())),
        step_(std::max(static_cast<double>(map_width_) / columns,
                       static_cast<double>(map_height_) / (2 * rows))),
        width_(std::max(1, static_cast<int>(map_width_ / step_))),
        height_(std::max(2, static_cast<int>(map_height_ / step_) & ~1)) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] double step() const { return step_; }

  /// The mean of what lies under a pixel; grey where most of it is untrusted.
  [[nodiscard]] Colour at(int x, int y, double full_scale_mm) const {
    const auto [left, right] = span(x, map_width_);
    const auto [top, bottom] = span(y, map_height_);
    double sum = 0;
    int trusted = 0;
    for (int row = top; row < bottom; ++row) {
      for (int column = left; column < right; ++column) {
        const float mm = mm_[static_cast<std::size_t>(row) * static_cast<std::size_t>(map_width_) +
                             static_cast<std::size_t>(column)];
        if (std::isnan(mm)) continue;
        sum += mm;
        ++trusted;
      }
    }
    if (2 * trusted < (right - left) * (bottom - top)) return cli::kUntrustedColour;
    return cli::colour_of(sum / trusted / full_scale_mm);
  }

 private:
  [[nodiscard]] std::pair<int, int> span(int pixel, int size) const {
    const int from = std::min(static_cast<int>(pixel * step_), size - 1);
    const int to = static_cast<int>((pixel + 1) * step_);
    return {from, std::clamp(to, from + 1, size)};
  }

  std::vector<float> mm_;
  int map_width_;
  int map_height_;
  double step_;
  int width_;
  int height_;
};

std::string legend(double full_scale_mm, double mm_per_column, const Canvas& canvas) {
  Pen pen(canvas.palette);
  const int colours = std::min(kColours, canvas.columns - kDepthColumns);
  for (int i = 0; i < colours; ++i) {
    const Colour colour = cli::colour_of((i + 0.5) / colours);
    pen.put(" ", colour, colour);
  }
  std::string text = pen.finish(fmt::format(" {:g} mm deep", full_scale_mm));
  const double length_mm = cli::round_up(4 * mm_per_column);
  const int length = static_cast<int>(std::lround(length_mm / mm_per_column));
  constexpr int kLengthColumns = 10;  // "  " and " 0.2 mm"
  if (colours + kDepthColumns + length + kLengthColumns > canvas.columns) return text;
  text += "  |";
  for (int i = 2; i < length; ++i) text += '-';
  return text + fmt::format("| {:g} mm", length_mm);
}

}  // namespace

std::vector<std::string> picture_of(const v1::Frame& frame, double full_scale_mm,
                                    const Canvas& canvas) {
  const v1::DepthMap& map = frame.depth();
  // The legend, and a line that is the caller's.
  const Pixels pixels(map, canvas.columns, canvas.rows - 2);
  const double mm_per_pixel = pixels.step() * map.mm_per_px();
  const bool crossed = frame.contact().in_contact();
  const int cross_x =
      pixels.width() / 2 + static_cast<int>(std::floor(frame.contact().x_mm() / mm_per_pixel));
  const int cross_y =
      pixels.height() / 2 + static_cast<int>(std::floor(frame.contact().y_mm() / mm_per_pixel));
  std::vector<std::string> lines;
  Pen pen(canvas.palette);
  for (int y = 0; y < pixels.height(); y += 2) {
    for (int x = 0; x < pixels.width(); ++x) {
      const Colour upper = pixels.at(x, y, full_scale_mm);
      const Colour lower = pixels.at(x, y + 1, full_scale_mm);
      if (crossed && x == cross_x && y / 2 == cross_y / 2) {
        const bool dark = upper.g < 128;
        pen.put("+", dark ? Colour{255, 255, 255} : Colour{}, upper);
      } else {
        pen.put("\u2580", upper, lower);  // the upper half of the character
      }
    }
    lines.push_back(pen.finish());
  }
  lines.push_back(legend(full_scale_mm, mm_per_pixel, canvas));
  return lines;
}

}  // namespace dtact::ctl
