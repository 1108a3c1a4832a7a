#include "tests/accuracy/real/press_images.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "hal/files/png.hpp"

namespace dtact {
namespace {

cv::Mat1f load(const std::filesystem::path& path) {
  const image::Grey8 image = image::read_png_grey8(path);
  cv::Mat1f levels(image.height, image.width);
  std::ranges::copy(image.pixels, levels.begin());
  return levels;
}

float as_camera(double level) {
  return static_cast<float>(std::clamp(std::round(level), 0.0, 255.0));
}

/// Calls `change(level, x, y)` for each pixel, x and y from 0 to 1 across the image.
template <typename Change>
cv::Mat1f changed(const cv::Mat1f& image, const Change& change) {
  cv::Mat1f out(image.size());
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      out(y, x) = as_camera(change(image(y, x), static_cast<double>(x) / (image.cols - 1),
                                   static_cast<double>(y) / (image.rows - 1)));
    }
  }
  return out;
}

}  // namespace

std::optional<std::filesystem::path> sensor_folder(const char* sensor) {
  std::filesystem::path folder = std::filesystem::path(DTACT_SHARED_DIR) / "data" / sensor;
  if (!std::filesystem::exists(folder)) return std::nullopt;
  return folder;
}

PressImages load_pair(const std::filesystem::path& folder, const char* object) {
  return {load(folder / (std::string(object) + "_reference.png")),
          load(folder / (std::string(object) + ".png"))};
}

PressImages turned(const PressImages& board) {
  PressImages out;
  cv::rotate(board.reference, out.reference, cv::ROTATE_90_CLOCKWISE);
  cv::rotate(board.frame, out.frame, cv::ROTATE_90_CLOCKWISE);
  return out;
}

PressImages dark_corners(const PressImages& board) {
  const auto darken = [](float level, double x, double y) {
    return level * (1 - 0.75 * 2 * ((x - 0.5) * (x - 0.5) + (y - 0.5) * (y - 0.5)));
  };
  return {changed(board.reference, darken), changed(board.frame, darken)};
}

PressImages tilted(const PressImages& board) {
  return {board.reference.clone(), changed(board.frame, [](float level, double x, double y) {
            return level - 12 * x - 6 * y;
          })};
}

PressImages leaking(const PressImages& board) {
  return {changed(board.reference, [](float level, double,
                                      double y) { return level + 30 * std::exp(-(1 - y) / 0.03); }),
          changed(board.frame,
                  [](float level, double x, double) { return level + 30 * std::exp(-x / 0.03); })};
}

PressImages without_pin(const PressImages& board, cv::Point place, double radius) {
  PressImages out{board.reference.clone(), board.frame.clone()};
  double sum = 0;
  int count = 0;
  const auto each = [&](double from, double to, const auto& visit) {
    for (int y = 0; y < out.frame.rows; ++y) {
      for (int x = 0; x < out.frame.cols; ++x) {
        const double r = std::hypot(x - place.x, y - place.y);
        if (r >= from && r < to) visit(x, y);
      }
    }
  };
  each(radius, radius + 3, [&](int x, int y) {
    sum += board.reference(y, x) - board.frame(y, x);
    ++count;
  });
  cv::RNG random(2);
  each(0, radius, [&](int x, int y) {
    out.frame(y, x) = as_camera(out.reference(y, x) - sum / count + random.gaussian(1));
  });
  return out;
}

}  // namespace dtact
