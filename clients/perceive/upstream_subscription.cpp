#include "clients/perceive/upstream_subscription.hpp"

#include <algorithm>

#include "clients/perceive/recognition/touch_map.hpp"

namespace dtact::perceive {

using net::Subscription;

void UpstreamSubscription::add(const Subscription& subscription) {
  const Subscription::Parts parts = subscription.parts();
  if (parts != 0) summary_ = true;
  if ((parts & Subscription::kPose) != 0) {
    pose_ = depth_ = true;
    decimation_ = 1;
  }
  if ((parts & Subscription::kRecognition) != 0) {
    recognition_ = true;
    depth_ |= in_contact_;
    whole_ |= in_contact_;
    while (decimation_ > 1 && decimation_ * mm_per_px_ > TouchMap::kCellMm) decimation_ /= 2;
  }
  if ((parts & Subscription::kCloud) == 0) return;
  const net::FrameKind kind = subscription.kind(Subscription::kCloud);
  if (!kind.contact_box && !in_contact_) return;
  depth_ = true;
  whole_ |= !kind.contact_box;
  decimation_ = std::min(decimation_, kind.spec.decimation);
}

v1::Subscribe UpstreamSubscription::subscription() const {
  v1::Subscribe wanted;
  wanted.set_events(false);
  if (summary_) wanted.set_summary(true);
  if (!depth_) return wanted;
  wanted.set_depth(v1::DEPTH_INT16);
  if (!whole_) wanted.set_contact_box(true);
  if (decimation_ > 1) wanted.set_decimation(static_cast<std::uint32_t>(decimation_));
  return wanted;
}

}  // namespace dtact::perceive
