#pragma once

#include "daemon/serve/subscription.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {

/// What all clients together need of the daemon, and nothing more: without contact no whole
/// map, of whose points nobody is sent any.
class UpstreamSubscription {
 public:
  explicit UpstreamSubscription(bool in_contact) : in_contact_(in_contact) {}

  /// What one more client wants.
  void add(const net::Subscription& subscription);

  [[nodiscard]] v1::Subscribe subscription() const;
  /// The touched object's motion is to be followed.
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
