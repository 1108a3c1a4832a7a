#pragma once

#include "daemon/serve/subscription.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {

/// The union of what all clients need from the daemon. Without contact it has no whole map,
/// because no client then receives points.
class UpstreamSubscription {
 public:
  explicit UpstreamSubscription(bool in_contact) : in_contact_(in_contact) {}

  /// What one more client wants.
  void add(const net::Subscription& subscription);

  [[nodiscard]] v1::Subscribe subscription() const;
  /// A client needs the pose of the object in contact.
  [[nodiscard]] bool pose() const noexcept { return pose_; }

 private:
  bool in_contact_;
  bool summary_ = false;
  bool pose_ = false;
  bool depth_ = false;
  bool whole_ = false;
  int decimation_ = 4;
};

}  // namespace dtact::perceive
