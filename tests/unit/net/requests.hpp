#pragma once

#include "proto/dtact.pb.h"

namespace dtact::net::test {

inline v1::ClientMessage get_status() {
  v1::ClientMessage message;
  message.mutable_get_status();
  return message;
}

inline v1::ClientMessage subscribe() {
  v1::ClientMessage message;
  message.mutable_subscribe();
  return message;
}

}  // namespace dtact::net::test
