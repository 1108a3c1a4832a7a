#include "tests/bench/opencv_pipeline.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace dtact::bench {

OpenCvPipeline::OpenCvPipeline(const LensMap& lens, const std::vector<std::uint16_t>& reference_q8,
                               std::span<const float> lut_mm_of)
    : list_(1, 256, CV_32F) {
  cv::setNumThreads(1);
  cv::Mat x(kMapSide, kMapSide, CV_32F);
  cv::Mat y(kMapSide, kMapSide, CV_32F);
  std::ranges::copy(lens.x, x.begin<float>());
  std::ranges::copy(lens.y, y.begin<float>());
  cv::convertMaps(x, y, map_xy_, map_fraction_, CV_16SC2);
  std::ranges::copy(lut_mm_of, list_.begin<float>());
  cv::Mat reference_image(kFrameHeight, kFrameWidth, CV_8U);
  std::ranges::transform(reference_q8, reference_image.begin<std::uint8_t>(), [](std::uint16_t q8) {
    return static_cast<std::uint8_t>((q8 + 128) / 256);
  });
  cv::remap(reference_image, reference_, map_xy_, map_fraction_, cv::INTER_LINEAR);
}

const cv::Mat& OpenCvPipeline::run(const Image& frame) {
  const cv::Mat grey(kFrameHeight, kFrameWidth, CV_8U, const_cast<std::uint8_t*>(frame.data()));
  cv::remap(grey, rectified_, map_xy_, map_fraction_, cv::INTER_LINEAR);
  cv::subtract(reference_, rectified_, difference_);
  cv::LUT(difference_, list_, depth_);
  cv::GaussianBlur(depth_, depth_, {7, 7}, 0);
  cv::GaussianBlur(depth_, depth_, {7, 7}, 0);
  return depth_;
}

}  // namespace dtact::bench
