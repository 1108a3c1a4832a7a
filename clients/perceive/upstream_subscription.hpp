#pragma once

#include "daemon/serve/subscription.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {

/// The union of what all clients need from the daemon. Without contact it has no whole map,
/// because no client then receives points.
class UpstreamSubscription {
 public:
  /// `mm_per_px`: of the daemon's map at full resolution; 0 before one has come.
  UpstreamSubscription(bool in_contact, double mm_per_px)
      : in_contact_(in_contact), mm_per_px_(mm_per_px) {}

  /// What one more client wants.
  void add(const net::Subscription& subscription);

  [[nodiscard]] v1::Subscribe subscription() const;
  /// A client needs the pose of the object in contact.
  [[nodiscard]] bool pose() const noexcept { return pose_; }
  /// A client needs to know what the object in contact is.
  [[nodiscard]] bool recognition() const noexcept { return recognition_; }

 private:
  bool in_contact_;
  double mm_per_px_;
  bool summary_ = false;
  bool pose_ = false;
  bool recognition_ = false;
  bool depth_ = false;
  bool whole_ = false;
  int decimation_ = 4;
};

}  // namespace dtact::perceive
