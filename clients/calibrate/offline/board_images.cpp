#include "clients/calibrate/offline/board_images.hpp"

#include <algorithm>

namespace dtact::ctl {

cv::Mat1f mean_levels(const ImageSet& set) {
  const image::Grey16 mean = set.mean_q8();
  cv::Mat1f levels(mean.height, mean.width);
  std::ranges::transform(mean.pixels, levels.begin(),
                         [](std::uint16_t q8) { return static_cast<float>(q8) / 256; });
  return levels;
}

std::vector<cv::Mat1b> grey_images(const ImageSet& set) {
  std::vector<cv::Mat1b> images;
  for (const image::Grey8& frame : set.frames()) {
    images.emplace_back(frame.height, frame.width);
    std::ranges::copy(frame.pixels, images.back().begin());
  }
  return images;
}

}  // namespace dtact::ctl
