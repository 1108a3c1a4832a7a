#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "proto/dtact.pb.h"
#include "tests/unit/net/raw_client.hpp"

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

inline v1::ClientMessage brightness(std::uint32_t value) {
  v1::ClientMessage message;
  message.mutable_set_light()->set_brightness(value);
  return message;
}

/// Expects the request to be refused as invalid, with a message that contains `part`.
inline void expect_invalid(RawClient& client, const v1::ClientMessage& message,
                           const std::string& part) {
  const auto reply = client.request(message);
  EXPECT_EQ(reply.error().code(), v1::ERROR_INVALID);
  EXPECT_THAT(reply.error().message(), testing::HasSubstr(part));
}

}  // namespace dtact::net::test
