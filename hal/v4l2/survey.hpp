#pragma once

#include <vector>

#include "hal/v4l2/finder.hpp"
#include "hal/v4l2/modes.hpp"
#include "hal/v4l2/photometry.hpp"

namespace dtact::hal::v4l2 {

/// An attached camera with all it offers, or a node that is not taken, with the reason alone.
struct SurveyedCamera {
  Attached attached;
  std::vector<Mode> modes;
  std::vector<OfferedControl> controls;  ///< Those of the photometric lock.
};

/// Every video node, as list_nodes() orders them. Only asks: a camera that streams for somebody is
/// not disturbed.
[[nodiscard]] std::vector<SurveyedCamera> survey_cameras();

}  // namespace dtact::hal::v4l2
