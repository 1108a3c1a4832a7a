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
  std::promise<void> sends;  ///< Set where a test's `up` does so.
  std::unique_ptr<cli::Link> link;

  void connect(Options options, cli::Link::Handlers handlers) {
    link = std::make_unique<cli::Link>(std::move(options), std::move(handlers));
    made.set_value();
  }
};

/// More than the buffers of two sockets hold.
std::string large_upload() {
  v1::ClientMessage message;
  message.mutable_upload_calibration()->mutable_reference_png()->resize(12'000'000, 'p');
  return message.SerializeAsString();
}

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

// Before: an upload over a slow network ended the connection after the timeout, for all viewers of
// a gateway.
TEST(Link, WaitsLongerForALargeMessageThanForASmallOne) {
  Linked linked;
  std::promise<std::size_t> received;
  PlayedDaemon daemon({[&](Peer& peer) {
    peer.greet();
    std::this_thread::sleep_for(std::chrono::seconds(3));
    received.set_value(peer.request().upload_calibration().reference_png().size());
    (void)peer.ends_silently();
  }});
  daemon.options.timeout = std::chrono::seconds(2);
  std::promise<std::string> down;
  linked.connect(daemon.options,
                 {.up = [&](const v1::HelloReply&, bool) { linked.sends.set_value(); },
                  .down = [&](const std::string& reason) { down.set_value(reason); },
                  .message = [](const std::string&) {}});
  linked.sends.get_future().wait();
  linked.link->send(large_upload());
  std::future<std::size_t> size = received.get_future();
  std::future<std::string> reason = down.get_future();
  ASSERT_EQ(size.wait_for(kLong), std::future_status::ready) << reason.get();
  EXPECT_EQ(size.get(), 12'000'000U);
  linked.link.reset();
}

TEST(Link, StopsInTheMiddleOfALargeMessage) {
  Linked linked;
  std::promise<void> stopped;
  std::promise<std::future_status> seen;
  PlayedDaemon daemon({[&](Peer& peer) {
    peer.greet();
    seen.set_value(stopped.get_future().wait_for(kLong));
  }});
  linked.connect(daemon.options,
                 {.up = [&](const v1::HelloReply&, bool) { linked.sends.set_value(); },
                  .down = [](const std::string&) {},
                  .message = [](const std::string&) {}});
  linked.sends.get_future().wait();
  linked.link->send(large_upload());
  linked.link.reset();
  stopped.set_value();
  EXPECT_EQ(seen.get_future().get(), std::future_status::ready);
}

}  // namespace
}  // namespace dtact::client::test
