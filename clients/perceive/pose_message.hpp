#pragma once

#include "clients/perceive/pose/tracker.hpp"

namespace dtact::v1 {
class ObjectPose;
}

namespace dtact::perceive {

/// Fills a message that is empty; but for `track_ns`.
void fill(const Tracker::Pose& pose, v1::ObjectPose& out);

}  // namespace dtact::perceive
