#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "clients/calibrate/offline/images.hpp"

namespace dtact::ctl {

/// The mean of a set, grey levels.
[[nodiscard]] cv::Mat1f mean_levels(const ImageSet& set);

/// Each image of a set as OpenCV's.
[[nodiscard]] std::vector<cv::Mat1b> grey_images(const ImageSet& set);

}  // namespace dtact::ctl
