// dtact-perceive's server with a daemon that a test plays.
#include "clients/perceive/server.hpp"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "clients/cpp/client.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace dtact::perceive {
namespace {

using client::test::kLong;
using client::test::Peer;
using client::test::PlayedDaemon;

/// The server on a thread of its own.
class Running {
 public:
  explicit Running(const client::Options& daemon) {
    net::NetConfig config;
    config.port = 0;
    config.features = wire::kPerceiveFeatures;
    server_ = std::make_shared<Server>(io_, config, daemon);
    server_->start();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~Running() {
    boost::asio::post(io_, [this] { server_->stop(); });
    thread_.join();
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  [[nodiscard]] client::Client connect() const {
    client::Options options;
    options.port = server_->port();
    return client::Client(options);
  }

 private:
  boost::asio::io_context io_;
  std::shared_ptr<Server> server_;
  std::thread thread_;
};

/// The first status for which `done` is true; after kLong the last one.
v1::Status status_when(client::Client& client, const std::function<bool(const v1::Status&)>& done) {
  const auto end = std::chrono::steady_clock::now() + kLong;
  for (;;) {
    v1::Status status = client.status();
    if (done(status) || std::chrono::steady_clock::now() > end) return status;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}
void greet(Peer& peer) {
  v1::Reply reply;
  v1::HelloReply& hello = *reply.mutable_hello();
  hello.set_major(wire::kMajor);
  hello.set_program("dtactd 9.8.7");
  hello.set_name("left");
  hello.set_serial("S7");
  hello.mutable_surface_frame()->set_frame_id("left_finger");
  peer.answer(std::move(reply));
}

TEST(Server, IntroducesItselfWithTheDaemonsNameAndFrame) {
  PlayedDaemon daemon({[](Peer& peer) {
    greet(peer);
    for (;;) peer.done();
  }});
  const Running running(daemon.options);
  client::Client first = running.connect();
  const v1::Status status =
      status_when(first, [](const v1::Status& one) { return !one.serial().empty(); });
  EXPECT_EQ(status.name(), "left");
  EXPECT_EQ(status.serial(), "S7");
  const client::Client client = running.connect();
  EXPECT_EQ(client.server().surface_frame().frame_id(), "left_finger");
  EXPECT_EQ(client.server().name(), "left");
  EXPECT_EQ(client.server().serial(), "S7");
}

}  // namespace
}  // namespace dtact::perceive
