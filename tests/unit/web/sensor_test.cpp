#include "clients/web/sensor.hpp"

#include <gtest/gtest.h>

#include <array>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <future>
#include <memory>
#include <string>
#include <utility>

#include "clients/web/page.hpp"
#include "clients/web/server.hpp"
#include "clients/web/source.hpp"
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
