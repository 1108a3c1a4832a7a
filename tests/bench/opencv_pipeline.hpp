#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>

#include "tests/bench/scene.hpp"

namespace dtact::bench {

/// The paper's pipeline in C++ with OpenCV, as a careful user would write it: grey
/// throughout, fixed-point remap of the crop only, subtract, LUT, two 7×7 Gaussian
/// filters.
class OpenCvPipeline {
 public:
  /// `lut_mm_of`: depth of the darkening 0 … 255 grey levels, millimetres.
  OpenCvPipeline(const LensMap& lens, const std::vector<std::uint16_t>& reference_q8,
                 std::span<const float> lut_mm_of);

  /// Millimetres, kMapSide². Valid until the next call.
  const cv::Mat& run(const Image& frame);

 private:
  cv::Mat map_xy_;
  cv::Mat map_fraction_;
  cv::Mat list_;
  cv::Mat reference_;
  cv::Mat rectified_;
  cv::Mat difference_;
  cv::Mat depth_;
};

}  // namespace dtact::bench
