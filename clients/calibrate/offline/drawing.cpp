#include "clients/calibrate/offline/drawing.hpp"

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

}  // namespace dtact::ctl
