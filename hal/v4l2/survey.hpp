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

/// Every video node, ordered as by list_nodes(). Read-only: a camera that streams for another
/// program is not disturbed.
[[nodiscard]] std::vector<SurveyedCamera> survey_cameras();

}  // namespace dtact::hal::v4l2
