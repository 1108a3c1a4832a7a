#pragma once

#include <string>

#include "clients/common/depth_file.hpp"

namespace dtact::ctl {

/// PNG: the map in colours beside a legend in millimetres, a bar of the scale below.
[[nodiscard]] std::string encode_colour_png(const cli::DepthImage& depth);

}  // namespace dtact::ctl
