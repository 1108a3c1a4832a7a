// The connection on a thread of its own, which gateways and bridges have.
#include "clients/common/link.hpp"

#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <string>

#include "tests/unit/client/played_daemon.hpp"

namespace dtact::client::test {
namespace {

/// A daemon's play may begin once the link can be used.
struct Linked {
  std::promise<void> made;
  std::unique_ptr<cli::Link> link;

  void connect(Options options, cli::Link::Handlers handlers) {
    link = std::make_unique<cli::Link>(std::move(options), std::move(handlers));
    made.set_value();
  }
};

std::string ping() {
  v1::ClientMessage message;
  message.set_id(7);
  message.mutable_ping();
  return message.SerializeAsString();
}

// Before: a handler slower than the stream kept everything that was to be sent.
TEST(Link, SendsBetweenTwoFramesThatLieReady) {
  Linked linked;
  std::promise<bool> pinged;
  PlayedDaemon daemon({[&](Peer& peer) {
    peer.greet();
    linked.made.get_future().wait();
    v1::ServerMessage first;
    first.mutable_frame()->set_sequence(3);
    v1::ServerMessage second;
    second.mutable_frame()->set_sequence(4);
    peer.send_bytes(framed(first) + framed(second));
    pinged.set_value(peer.request().has_ping());
    (void)peer.ends_silently();
  }});
  std::future<bool> arrived = pinged.get_future();
  std::promise<std::future_status> seen;
  linked.connect(daemon.options, {.up = [](const v1::HelloReply&, bool) {},
                                  .down = [](const std::string&) {},
                                  .message =
                                      [&](const std::string& bytes) {
                                        v1::ServerMessage message;
                                        ASSERT_TRUE(message.ParseFromString(bytes));
                                        if (message.frame().sequence() == 3)
                                          linked.link->send(ping());
                                        if (message.frame().sequence() == 4)
                                          seen.set_value(arrived.wait_for(kLong));
                                      }});
  EXPECT_EQ(seen.get_future().get(), std::future_status::ready);
  linked.link.reset();
}

}  // namespace
}  // namespace dtact::client::test
