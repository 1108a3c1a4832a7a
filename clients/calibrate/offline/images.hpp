#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/offline/images.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl {

/// Frames of one scene, all of one size.
struct ImageSet {
  std::vector<image::Grey16> images;  ///< Full scale 65535.
  std::vector<calibration::Origin::Source> sources;

  [[nodiscard]] int width() const { return images.front().width; }
  [[nodiscard]] int height() const { return images.front().height; }
  /// The frames as 8-bit luma, the daemon's format.
  [[nodiscard]] std::vector<image::Grey8> frames() const;
  /// The mean as Q8 luma (grey level times 256).
  [[nodiscard]] image::Grey16 mean_q8() const;
};

/// Reads PNG files; a folder means the PNG files in it, by name. `option` names the command
/// line's option in errors. Throws std::runtime_error naming the file.
[[nodiscard]] ImageSet load_images(const std::vector<std::string>& paths,
                                   const std::string& option);

/// Throws std::runtime_error when two sets differ in size.
void require_same_size(const ImageSet& a, const std::string& a_option, const ImageSet& b,
                       const std::string& b_option);

/// Two numbers from 2 to 100, as "7x9". Throws std::runtime_error naming the option.
[[nodiscard]] std::pair<int, int> pair_of(const std::string& text, const char* option);

/// The mean of a set, grey levels.
[[nodiscard]] cv::Mat1f mean_levels(const ImageSet& set);

/// The images of a set as OpenCV's.
[[nodiscard]] std::vector<cv::Mat1b> grey_images(const ImageSet& set);

}  // namespace dtact::ctl
