#include "daemon/announce/service.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <net/if.h>

#include <string>
#include <utility>

namespace dtact::announce {
namespace {

using testing::ElementsAre;
using testing::Pair;

// proto/README.md lists the keys; a string of a TXT record has at most 255 bytes (RFC 6763).
TEST(Service, TxtSaysWhatAClientNeedsBeforeItConnects) {
  EXPECT_THAT(txt_of({.version = "0.1.0",
                      .serial = "usb-1.2",
                      .instance = "81f3",
                      .tls = true,
                      .token = false}),
              ElementsAre("version=0.1.0", "serial=usb-1.2", "instance=81f3", "tls=1", "token=0"));
  EXPECT_THAT(txt_of({.version = "0.1.0",
                      .serial = std::string(300, 's'),
                      .instance = "",
                      .tls = false,
                      .token = true}),
              ElementsAre("version=0.1.0", "serial=" + std::string(248, 's'), "instance=", "tls=0",
                          "token=1"));
}

TEST(Service, LoopbackIsNotReachable) {
  for (const char* address : {"127.0.0.1", "127.8.0.2", "::1", "localhost", ""}) {
    EXPECT_FALSE(is_reachable(address)) << address;
  }
  for (const char* address : {"0.0.0.0", "::", "192.0.2.7", "2001:db8::7"}) {
    EXPECT_TRUE(is_reachable(address)) << address;
  }
}

/// Interface and protocol under which a daemon that listens on `address` is published.
std::pair<int, int> place_of(const std::string& address) {
  Service service;
  restrict_to(address, service);
  return {service.interface, service.protocol};
}

// Protocol 0 = IPv4, 1 = IPv6; -1 = both, or every interface. 192.0.2.7 and 2001:db8::7 are
// addresses for documentation, which no interface has.
TEST(Service, IsPublishedWhereItIsServed) {
  EXPECT_THAT(place_of("0.0.0.0"), Pair(-1, 0));
  EXPECT_THAT(place_of("::"), Pair(-1, -1));
  EXPECT_THAT(place_of("192.0.2.7"), Pair(-1, 0));
  EXPECT_THAT(place_of("2001:db8::7"), Pair(-1, 1));
  EXPECT_THAT(place_of(""), Pair(-1, -1));
  const auto loopback = static_cast<int>(::if_nametoindex("lo"));
  ASSERT_GT(loopback, 0);
  EXPECT_THAT(place_of("127.0.0.1"), Pair(loopback, 0));
}

}  // namespace
}  // namespace dtact::announce
