#include "clients/web/sensor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/buffers_iterator.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "clients/web/page.hpp"
#include "clients/web/server.hpp"
#include "clients/web/source.hpp"
#include "clients/web/web_socket.hpp"
#include "daemon/serve/admission.hpp"
#include "tests/unit/client/played_daemon.hpp"
#include "tests/unit/web/no_descriptors.hpp"

namespace dtact::web {
namespace {

using client::test::kLong;
using client::test::Peer;
using client::test::PlayedDaemon;
using std::chrono::seconds;
using std::chrono::steady_clock;

/// Runs `io` until `done()`, at most for kLong.
template <typename Done>
void run_until(boost::asio::io_context& io, Done done) {
  io.restart();  // which ran out of work before
  const auto work = boost::asio::make_work_guard(io);
  const auto end = steady_clock::now() + kLong;
  while (!done() && steady_clock::now() < end) io.run_for(std::chrono::milliseconds(10));
}

/// A source whose daemon says nothing after its greeting.
struct Connected {
  Connected() {
    source->start();
    run_until(io, [this] { return source->connected(); });
  }
  ~Connected() { source->stop(); }
  Connected(const Connected&) = delete;
  Connected& operator=(const Connected&) = delete;

  PlayedDaemon daemon{{[](Peer& peer) {
    peer.greet();
    (void)peer.ends_silently();
  }}};
  boost::asio::io_context io;
  std::shared_ptr<Source> source = std::make_shared<Source>(io, "left", daemon.options);
};

// Before: what somebody had asked for hours ago.
TEST(Sensor, ShowsNoOldStatus) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    v1::Reply reply;
    reply.mutable_status()->set_state(v1::STATE_SERVING);
    peer.answer(reply);
    (void)peer.ends_silently();
  }});
  boost::asio::io_context io;
  const net::NetConfig config;
  net::Admission admission(config);
  const auto source = std::make_shared<Source>(io, "left", daemon.options);
  const auto sensor = std::make_shared<Sensor>(io, source, config, admission);
  sensor->start();
  source->start();
  const auto shows_status = [&](seconds later) {
    return sensor->entry_with_status(steady_clock::now() + later).find("\"status\"") !=
           std::string::npos;
  };
  run_until(io, [&] { return source->connected(); });
  EXPECT_FALSE(shows_status(seconds(0)));
  sensor->ask_status();
  run_until(io, [&] { return shows_status(seconds(0)); });
  EXPECT_TRUE(shows_status(seconds(0)));
  EXPECT_FALSE(shows_status(seconds(5)));
  sensor->stop();
  source->stop();
}

TEST(Source, WithoutDescriptorsRefusesASubscription) {
  if (test::kNeedsDescriptors) GTEST_SKIP() << "the sanitizer needs descriptors";
  Connected connected;
  const auto& source = connected.source;
  ASSERT_TRUE(source->connected());
  v1::Subscribe request;
  request.set_summary(true);
  v1::Reply answer;
  {
    const test::NoDescriptors none;
    source->subscribe(
        {.who = &answer, .owner = "test", .may_control = true}, request,
        [&](const v1::Reply& reply) { answer = reply; }, [](const RelayedFrame&, std::uint64_t) {});
  }
  EXPECT_EQ(answer.error().code(), v1::ERROR_BUSY);
  EXPECT_TRUE(answer.error().message().starts_with("no more subscriptions to left are made: "))
      << answer.error().message();
}

// Each is a thread and a client of the daemon, before the daemon has answered, too.
TEST(Source, SubscriptionsThatAreBeingOpenedCount) {
  Connected connected;
  const auto& source = connected.source;
  ASSERT_TRUE(source->connected());
  v1::Reply answer;
  for (std::size_t i = 0; i <= Source::kMaxFeedsOfOne; ++i) {
    EXPECT_FALSE(answer.has_error()) << i;
    v1::Subscribe request;
    request.set_summary(true);
    request.set_summary_hz(1 + static_cast<double>(i));
    source->subscribe(
        {.who = &connected, .owner = "test", .may_control = true}, request,
        [&](const v1::Reply& reply) { answer = reply; }, [](const RelayedFrame&, std::uint64_t) {});
  }
  EXPECT_EQ(answer.error().code(), v1::ERROR_BUSY);
  EXPECT_TRUE(answer.error().message().starts_with("test has 5 different subscriptions to left"))
      << answer.error().message();
}

// Before: its viewer got the answer Done, and no frame.
TEST(Source, ARefusedSubscriptionLeavesOneThatIsBeingOpened) {
  base::UniqueFd listening = client::test::listen_on();
  const int fd = listening.get();
  std::promise<void> asked;
  std::promise<void> refused;
  PlayedDaemon daemon({[&](Peer& peer) {
                        peer.greet();
                        Peer feed(fd, nullptr);
                        feed.greet();
                        v1::ServerMessage agreed;
                        agreed.mutable_reply()->set_id(feed.request().id());
                        agreed.mutable_reply()->mutable_done();
                        asked.set_value();
                        refused.get_future().wait();
                        feed.send(agreed);
                        feed.frame(41);
                        (void)peer.ends_silently();
                      }},
                      std::move(listening));
  boost::asio::io_context io;
  const auto source = std::make_shared<Source>(io, "left", daemon.options);
  source->start();
  run_until(io, [&] { return source->connected(); });
  v1::Reply answer;
  std::size_t frames = 0;
  const auto subscribe = [&](const void* who, double hz) {
    v1::Subscribe request;
    request.set_summary(true);
    request.set_summary_hz(hz);
    answer = {};
    source->subscribe(
        {.who = who, .owner = "test", .may_control = true}, request,
        [&](const v1::Reply& reply) { answer = reply; },
        [&](const RelayedFrame&, std::uint64_t) { ++frames; });
  };
  std::array<char, Source::kMaxFeedsOfOne> viewers{};
  subscribe(&viewers.front(), 1);
  asked.get_future().wait();
  for (std::size_t i = 1; i < viewers.size(); ++i) {
    subscribe(&viewers[i], 1 + static_cast<double>(i));
  }
  EXPECT_FALSE(answer.has_error());
  subscribe(&viewers.front(), 100);
  EXPECT_EQ(answer.error().code(), v1::ERROR_BUSY);
  refused.set_value();
  run_until(io, [&] { return frames > 0; });
  EXPECT_TRUE(answer.has_done());
  EXPECT_EQ(frames, 1U);
  source->stop();
}

/// The WebSocket of a viewer: what it sends, and the messages that it receives.
class ViewerSocket final : public WebSocket {
 public:
  explicit ViewerSocket(boost::asio::io_context& io) : io_(io) {}

  void read_some(boost::asio::mutable_buffer into, OnRead done) override {
    into_ = into;
    read_ = std::move(done);
    deliver();
  }
  void write(const Parts& parts, bool text, Done done) override {
    const std::string bytes(boost::asio::buffers_begin(parts), boost::asio::buffers_end(parts));
    v1::ServerMessage message;
    // Behind the length.
    if (!text && message.ParseFromString(bytes.substr(4))) received.push_back(message);
    boost::asio::post(io_, [done = std::move(done), size = bytes.size()] { done({}, size); });
  }
  void end(std::shared_ptr<void> /*held*/) override {}
  void close() override { read_ = nullptr; }
  boost::asio::any_io_executor executor() override { return io_.get_executor(); }

  void send(v1::ClientMessage message) {
    message.set_id(++sent_);
    const auto length = wire::encode_length(message.ByteSizeLong());
    unread_.append(reinterpret_cast<const char*>(length.data()), length.size());
    message.AppendToString(&unread_);
    deliver();
  }
  [[nodiscard]] std::size_t count(bool (v1::ServerMessage::*has)() const) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(received, [has](const auto& one) { return (one.*has)(); }));
  }

  std::vector<v1::ServerMessage> received;

 private:
  void deliver() {
    if (!read_ || unread_.empty()) return;
    const std::size_t size = boost::asio::buffer_copy(into_, boost::asio::buffer(unread_));
    unread_.erase(0, size);
    boost::asio::post(io_, [done = std::exchange(read_, nullptr), size] {
      done({}, {.bytes = size, .text = false, .end = true});
    });
  }

  boost::asio::io_context& io_;
  boost::asio::mutable_buffer into_;
  OnRead read_;
  std::string unread_;
  std::uint64_t sent_ = 0;
};

// A viewer that is refused a subscription keeps the one that it has.
TEST(Sensor, ARefusedSubscriptionLeavesTheViewersOwn) {
  base::UniqueFd listening = client::test::listen_on();
  const int fd = listening.get();
  std::promise<void> seen;
  PlayedDaemon daemon({[&](Peer& peer) {
                        peer.greet();
                        Peer feed(fd, nullptr);
                        feed.greet();
                        feed.done();
                        feed.frame(41);
                        Peer refused(fd, nullptr);
                        refused.greet();
                        refused.refuse(v1::ERROR_INVALID, "subscribe.decimation: 3");
                        seen.get_future().wait();
                        feed.frame(42);
                        (void)peer.ends_silently();
                      }},
                      std::move(listening));
  boost::asio::io_context io;
  net::NetConfig config;
  config.log = [](const net::LogLine&) {};
  net::Admission admission(config);
  const auto source = std::make_shared<Source>(io, "left", daemon.options);
  const auto sensor = std::make_shared<Sensor>(io, source, config, admission);
  sensor->start();
  source->start();
  run_until(io, [&] { return source->connected(); });
  const auto viewer = std::make_shared<ViewerSocket>(io);
  net::Peer peer;
  peer.address = "192.0.2.7:40312";
  peer.host = "192.0.2.7";
  sensor->admit(viewer, peer, nullptr);
  const auto replies = [&] { return viewer->count(&v1::ServerMessage::has_reply); };
  const auto frames = [&] { return viewer->count(&v1::ServerMessage::has_frame); };
  v1::ClientMessage hello;
  hello.mutable_hello()->set_major(wire::kMajor);
  viewer->send(hello);
  run_until(io, [&] { return replies() == 1; });
  v1::ClientMessage subscribe;
  subscribe.mutable_subscribe()->set_summary(true);
  viewer->send(subscribe);
  run_until(io, [&] { return frames() == 1; });
  ASSERT_EQ(frames(), 1U);
  subscribe.mutable_subscribe()->set_decimation(3);
  viewer->send(subscribe);
  run_until(io, [&] { return replies() == 3; });
  EXPECT_EQ(viewer->received.back().reply().error().message(), "subscribe.decimation: 3");
  seen.set_value();
  run_until(io, [&] { return frames() == 2; });
  EXPECT_EQ(frames(), 2U);
  EXPECT_EQ(viewer->received.back().frame().sequence(), 42U);
  sensor->stop();
  source->stop();
}

// Before: a program on the desktop was refused as a foreign page until a daemon was found.
TEST(Server, ForFoxgloveNoSensorNeedsToBeFoundYet) {
  boost::asio::io_context io;
  Settings settings;
  settings.net.port = 0;
  settings.net.log = [](const net::LogLine&) {};
  settings.find = true;
  const Page page;
  const auto server = std::make_shared<Server>(io, std::move(settings), page);
  Request request;
  request.set(boost::beast::http::field::host, "127.0.0.1");
  request.set(boost::beast::http::field::origin, "file://");
  request.set(boost::beast::http::field::sec_websocket_protocol, "foxglove.sdk.v1");
  const auto status_of = [&](const char* path) {
    request.target(path);
    return server->upgrade(request, {}).refusal.status;
  };
  EXPECT_EQ(status_of("/sensors/left/foxglove"), boost::beast::http::status::forbidden);
  EXPECT_NE(status_of("/foxglove"), boost::beast::http::status::forbidden);
  server->stop();
}

// Before: the exception ended the program, which found the same daemons again.
TEST(Server, WithoutDescriptorsLeavesOutWhatIsFound) {
  if (test::kNeedsDescriptors) GTEST_SKIP() << "the sanitizer needs descriptors";
  boost::asio::io_context io;
  std::string log;
  Settings settings;
  settings.net.port = 0;
  settings.net.log = [&](const net::LogLine& line) { log += line.text + '\n'; };
  const Page page;
  const auto server = std::make_shared<Server>(io, std::move(settings), page);
  server->start();
  Request request;
  request.target("/sensors");
  request.set(boost::beast::http::field::host, "127.0.0.1");
  cli::Finder::Found found;
  found.daemon.name = "left";
  found.daemon.options.host = "unix:/no/such/socket";
  {
    const test::NoDescriptors none;
    server->add(found);
  }
  EXPECT_EQ(server->answer(request, {}).text, "[]");
  EXPECT_NE(log.find("left is left out: "), std::string::npos) << log;
  server->add(found);
  EXPECT_NE(server->answer(request, {}).text.find("left"), std::string::npos);
  server->stop();
}

}  // namespace
}  // namespace dtact::web
