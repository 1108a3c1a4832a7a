#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "clients/common/depth_file.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl {

/// A picture to draw on with OpenCV, whose channels are r, g, b.
using Picture = cv::Mat3b;

/// Height of a line of text, pixels.
inline constexpr int kTextHeight = 14;
/// Width of a text, pixels.
[[nodiscard]] int text_width(const std::string& text);
/// Writes a line of text with its upper left corner at `corner`.
void draw_text(Picture& picture, cv::Point corner, const std::string& text,
               const cv::Scalar& colour);

[[nodiscard]] image::Rgb8 to_image(const Picture& picture);

/// PNG: the map in colours beside a legend in millimetres, a bar of the scale below.
[[nodiscard]] std::string encode_legend_png(const cli::DepthImage& depth);

}  // namespace dtact::ctl
