// Messages to a client of the Foxglove protocol while its link is slow.
#include "clients/web/foxglove/foxglove_client.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/buffers_iterator.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/client/played_daemon.hpp"

namespace dtact::web::foxglove {
namespace {

namespace asio = boost::asio;

/// A socket whose writes end when the test says so.
class SlowSocket final : public WebSocket {
 public:
  explicit SlowSocket(asio::io_context& io) : io_(io) {}

  void read_some(asio::mutable_buffer into, OnRead done) override {
    into_ = into;
    read_ = std::move(done);
  }
  void write(const Parts& parts, bool /*text*/, Done done) override {
    sent.emplace_back(asio::buffers_begin(parts), asio::buffers_end(parts));
    written_ = std::move(done);
  }
  void end(std::shared_ptr<void> /*held*/) override {}
  void close() override {
    read_ = nullptr;
    written_ = nullptr;
  }
  asio::any_io_executor executor() override { return io_.get_executor(); }

  void receive(const std::string& text, bool end = true) {
    asio::buffer_copy(into_, asio::buffer(text));
    std::exchange(read_, nullptr)({}, {text.size(), true, end});
  }
  /// Ends the write under way. False: no write is under way.
  bool finish_write() {
    if (!written_) return false;
    std::exchange(written_, nullptr)({}, sent.back().size());
    return true;
  }

  std::vector<std::string> sent;

 private:
  asio::io_context& io_;
  asio::mutable_buffer into_;
  OnRead read_;
  Done written_;
};

TEST(FoxgloveClient, OnASlowLinkTheNewestMapWaits) {
  asio::io_context io;
  const auto socket = std::make_shared<SlowSocket>(io);
  const auto sensor =
      std::make_shared<SensorTopics>(std::make_shared<Source>(io, "left", client::Options{}));
  const auto client = std::make_shared<FoxgloveClient>(socket, std::vector<Mount>{{sensor, "", {}}},
                                                       net::Tokens::Grant{}, "viewer", "test",
                                                       [](const std::string&) {});
  client->start();
  while (socket->finish_write()) {
  }
  socket->receive(R"({"op":"subscribe","subscriptions":[{"id":7,"channelId":)" +
                  std::to_string(index(Topic::depth) + 1) + "}]}");
  socket->sent.clear();
  const auto publish = [&](const char* map) {
    client->on_message(*sensor, Topic::depth, std::make_shared<const Message>(Message{1, map}));
  };
  publish("first");  // on its way at once
  publish("second");
  publish("third");
  while (socket->finish_write()) {
  }
  ASSERT_EQ(socket->sent.size(), 2U);
  EXPECT_TRUE(socket->sent[0].ends_with("first"));
  EXPECT_TRUE(socket->sent[1].ends_with("third"));
  client->close("over");
}

TEST(FoxgloveClient, WithdrawsItsAlertWhenTheDaemonIsBack) {
  asio::io_context io;
  const auto socket = std::make_shared<SlowSocket>(io);
  const auto sensor =
      std::make_shared<SensorTopics>(std::make_shared<Source>(io, "left", client::Options{}));
  const auto client = std::make_shared<FoxgloveClient>(socket, std::vector<Mount>{{sensor, "", {}}},
                                                       net::Tokens::Grant{}, "viewer", "test",
                                                       [](const std::string&) {});
  client->start();
  while (socket->finish_write()) {
  }
  EXPECT_EQ(socket->sent.back(),
            R"({"op":"status","level":1,"message":"the daemon of left is away","id":"left"})");
  client->on_state(*sensor, true, "");
  while (socket->finish_write()) {
  }
  EXPECT_EQ(socket->sent.back(), R"({"op":"removeStatus","statusIds":["left"]})");
  client->close("over");
}

// Before: with depth of a dtact-perceive all of the client's subscriptions were refused.
TEST(FoxgloveClient, SubscriptionsEndWithTheirChannels) {
  base::UniqueFd listening = client::test::listen_on();
  const int fd = listening.get();
  std::promise<v1::Subscribe> asked;
  client::test::PlayedDaemon daemon({[&](client::test::Peer& peer) {
                                      peer.greet({"cloud"});
                                      client::test::Peer feed(fd, nullptr);
                                      feed.greet({"cloud"});
                                      asked.set_value(feed.request().subscribe());
                                      (void)peer.ends_silently();
                                    }},
                                    std::move(listening));
  asio::io_context io;
  const auto source = std::make_shared<Source>(io, "left", daemon.options);
  const auto sensor = std::make_shared<SensorTopics>(source);
  const auto socket = std::make_shared<SlowSocket>(io);
  const auto client = std::make_shared<FoxgloveClient>(socket, std::vector<Mount>{{sensor, "", {}}},
                                                       net::Tokens::Grant{}, "viewer", "test",
                                                       [](const std::string&) {});
  sensor->start();
  client->start();
  // Whatever serves there, it is taken for a dtactd until it has answered.
  for (const auto& [id, topic] : {std::pair(7, Topic::depth), std::pair(8, Topic::contact)}) {
    while (socket->finish_write()) {
    }
    socket->receive(
        fmt::format(R"({{"op":"subscribe","subscriptions":[{{"id":{},"channelId":{}}}]}})", id,
                    index(topic) + 1));
  }
  source->start();
  std::future<v1::Subscribe> subscription = asked.get_future();
  const auto work = asio::make_work_guard(io);
  const auto end = std::chrono::steady_clock::now() + client::test::kLong;
  while (subscription.wait_for(std::chrono::seconds(0)) != std::future_status::ready &&
         std::chrono::steady_clock::now() < end) {
    io.run_for(std::chrono::milliseconds(10));
  }
  const v1::Subscribe wanted = subscription.get();
  EXPECT_EQ(wanted.depth(), v1::DEPTH_NONE);
  EXPECT_TRUE(wanted.summary());
  client->close("over");
  sensor->stop();
  source->stop();
}

class NewestState : public SensorTopics::Listener {
 public:
  void on_message(const SensorTopics&, Topic, const std::shared_ptr<const Message>&) override {}
  void on_state(const SensorTopics&, bool well, const std::string& sentence) override {
    well_ = well;
    sentence_ = sentence;
  }
  bool well_ = false;
  std::string sentence_;
};

// The daemon is full when a second topic is asked for. Before: once its client had left, the stream
// of the first one went on for nobody.
TEST(SensorTopics, EndAStreamThatARefusalHasLeft) {
  base::UniqueFd listening = client::test::listen_on();
  const int fd = listening.get();
  std::promise<void> ended;
  client::test::PlayedDaemon daemon({[&](client::test::Peer& peer) {
                                      peer.greet();
                                      client::test::Peer first(fd, nullptr);
                                      first.greet();
                                      first.done();
                                      client::test::Peer second(fd, nullptr);
                                      second.greet();
                                      second.refuse(v1::ERROR_BUSY, "all places are taken");
                                      if (first.ends_silently()) ended.set_value();
                                      (void)peer.ends_silently();
                                    }},
                                    std::move(listening));
  asio::io_context io;
  const auto work = asio::make_work_guard(io);
  const auto end = std::chrono::steady_clock::now() + client::test::kLong;
  const auto run_until = [&](const std::function<bool()>& done) {
    while (!done() && std::chrono::steady_clock::now() < end) {
      io.run_for(std::chrono::milliseconds(10));
    }
    return done();
  };
  const auto source = std::make_shared<Source>(io, "left", daemon.options);
  const auto sensor = std::make_shared<SensorTopics>(source);
  NewestState state;
  sensor->start();
  source->start();
  Topics wanted;
  sensor->want(state, wanted.set(index(Topic::contact)));
  ASSERT_TRUE(run_until([&] { return state.well_; }));
  sensor->want(state, wanted.set(index(Topic::depth)));
  ASSERT_TRUE(run_until([&] { return state.sentence_ == "all places are taken"; }));
  sensor->forget(state);
  const std::future<void> left = ended.get_future();
  EXPECT_TRUE(run_until(
      [&] { return left.wait_for(std::chrono::seconds(0)) == std::future_status::ready; }));
  sensor->stop();
  source->stop();
}

// Before: Foxglove had to connect again for a sensor that was found later.
TEST(FoxgloveClient, GetsSensorsThatAreFoundLater) {
  asio::io_context io;
  const auto sensor_of = [&](const char* name) {
    return std::make_shared<SensorTopics>(std::make_shared<Source>(io, name, client::Options{}));
  };
  const auto socket = std::make_shared<SlowSocket>(io);
  const auto client = std::make_shared<FoxgloveClient>(
      socket, std::vector<Mount>{{sensor_of("left"), "/left", {}}}, net::Tokens::Grant{}, "viewer",
      "test", [](const std::string&) {});
  client->start();
  while (socket->finish_write()) {
  }
  socket->sent.clear();
  const auto right = sensor_of("right");
  client->add({right, "/right", {}});
  while (socket->finish_write()) {
  }
  ASSERT_EQ(socket->sent.size(), 3U);
  EXPECT_NE(socket->sent[0].find(fmt::format(R"("id":{},"topic":"/right/dtact/depth")",
                                             kTopics + index(Topic::depth) + 1)),
            std::string::npos)
      << socket->sent[0];
  EXPECT_EQ(socket->sent[0].find("/left"), std::string::npos);
  EXPECT_NE(socket->sent[1].find(
                fmt::format(R"("id":{},"name":"/right/dtact/set_light")", kServices + 1)),
            std::string::npos)
      << socket->sent[1];
  EXPECT_EQ(socket->sent[2],
            R"({"op":"status","level":1,"message":"the daemon of right is away","id":"right"})");
  socket->receive(fmt::format(R"({{"op":"subscribe","subscriptions":[{{"id":7,"channelId":{}}}]}})",
                              kTopics + index(Topic::depth) + 1));
  client->on_message(*right, Topic::depth, std::make_shared<const Message>(Message{1, "map"}));
  EXPECT_TRUE(socket->sent.back().ends_with("map"));
  client->close("over");
}

// Before: 40 clients that did not read had 620 MB of such answers.
TEST(FoxgloveClient, AnswersAreShortWhateverTheyRepeat) {
  asio::io_context io;
  const auto socket = std::make_shared<SlowSocket>(io);
  const auto client =
      std::make_shared<FoxgloveClient>(socket, std::vector<Mount>{}, net::Tokens::Grant{}, "viewer",
                                       "test", [](const std::string&) {});
  client->start();
  while (socket->finish_write()) {
  }
  for (int i = 0; i < 8; ++i)
    socket->receive(i == 0 ? "{\"op\":\"" : std::string(4000, 'x'), false);
  socket->receive("\"}", true);
  while (socket->finish_write()) {
  }
  EXPECT_EQ(socket->sent.back(), R"({"op":"status","level":1,"message":"\")" +
                                     std::string(64, 'x') + R"(\" is not done here"})");
  client->close("over");
}

}  // namespace
}  // namespace dtact::web::foxglove
