// Reconnection, and the ways to wait.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/tcp.h>
#include <poll.h>

#include <filesystem>
#include <stop_token>
#include <thread>

#include "clients/cpp/client.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace dtact::client::test {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;

Options patient(Options options) {
  options.reconnect = Reconnect{milliseconds(5), milliseconds(20)};
  return options;
}

template <typename T>
T next(Client& client) {
  auto item = client.next(kLong);
  if (!item.has_value()) throw std::runtime_error("silence");
  return std::get<T>(*std::move(item));
}

TEST(Reconnecting, TheSubscriptionSurvivesADaemonThatGoesAndComesBack) {
  auto first = std::make_unique<PlayedDaemon>(std::vector<PlayedDaemon::Play>{[](Peer& peer) {
    peer.greet();
    peer.done();
    peer.frame(41);
  }});
  const std::uint16_t port = first->options.port;
  Client client(patient(first->options));
  v1::Subscribe wanted = depth_stream();
  wanted.set_every(3);
  client.subscribe(wanted);
  EXPECT_EQ(next<v1::Frame>(client).sequence(), 41U);
  first.reset();
  // The port has no listener now.
  EXPECT_FALSE(client.next(milliseconds(50)).has_value());
  EXPECT_EQ(client.native_handle(), -1);
  v1::Subscribe seen;
  PlayedDaemon second({[&seen](Peer& peer) {
                        peer.greet({"jpeg"});
                        seen = peer.done().subscribe();
                        peer.frame(57);
                      }},
                      listen_on(port));
  const auto gap = next<Reconnected>(client);
  EXPECT_THAT(gap.reason, HasSubstr("ended the connection"));
  EXPECT_EQ(gap.last_sequence, 41U);
  EXPECT_GE(gap.away, milliseconds(50));
  EXPECT_EQ(next<v1::Frame>(client).sequence(), 57U);
  EXPECT_EQ(seen.SerializeAsString(), wanted.SerializeAsString());
  EXPECT_TRUE(client.has_feature("jpeg"));
}

TEST(Reconnecting, EachLossReportsItsOwnReason) {
  PlayedDaemon daemon({[](Peer& peer) {
                         peer.greet();
                         peer.done();
                         peer.frame(41);
                       },
                       [](Peer& peer) {
                         peer.greet();
                         peer.done();
                         peer.frame(57);
                         v1::ServerMessage end;
                         end.mutable_reply()->mutable_error()->set_code(v1::ERROR_FLOOD);
                         end.mutable_reply()->mutable_error()->set_message("too many requests");
                         peer.send(end);
                       },
                       [](Peer& peer) {
                         peer.greet();
                         peer.done();
                         peer.frame(60);
                       }});
  Client client(patient(daemon.options));
  client.subscribe();
  EXPECT_EQ(next<v1::Frame>(client).sequence(), 41U);
  const auto first = next<Reconnected>(client);
  EXPECT_THAT(first.reason, HasSubstr("ended the connection"));
  EXPECT_EQ(first.last_sequence, 41U);
  EXPECT_EQ(next<v1::Frame>(client).sequence(), 57U);
  const auto second = next<Reconnected>(client);
  EXPECT_THAT(second.reason, HasSubstr("too many requests"));
  EXPECT_EQ(second.last_sequence, 57U);
  EXPECT_EQ(next<v1::Frame>(client).sequence(), 60U);
}

TEST(Reconnecting, ARequestInFlightFailsAndIsNotSentAgain) {
  PlayedDaemon daemon({[](Peer& peer) {
                         peer.greet();
                         EXPECT_TRUE(peer.request().has_rezero());
                       },
                       [](Peer& peer) {
                         peer.greet();
                         EXPECT_TRUE(peer.done().has_set_light());
                       }});
  Client client(patient(daemon.options));
  EXPECT_THROW(client.rezero(), ConnectionError);
  (void)next<Reconnected>(client);
  (void)client.set_light({});
}

TEST(Reconnecting, ARequestTriesWhenTheNextAttemptIsDue) {
  PlayedDaemon daemon({[](Peer& peer) { peer.greet(); },
                       [](Peer& peer) {
                         peer.greet();
                         peer.frame(3);
                         v1::Reply reply;
                         reply.mutable_status()->set_version("9.8.7");
                         peer.answer(reply);
                       }});
  Client client(patient(daemon.options));
  EXPECT_THROW((void)client.status(), ConnectionError);
  v1::Status status;
  while (status.version().empty()) {
    try {
      status = client.status();
    } catch (const ConnectionError&) {
      continue;  // too early
    }
  }
  EXPECT_EQ(next<Reconnected>(client).last_sequence, 0U);
  EXPECT_EQ(next<v1::Frame>(client).sequence(), 3U);
}

TEST(Reconnecting, ABusyDaemonIsAskedAgain) {
  PlayedDaemon daemon({[](Peer& peer) { peer.greet(); },
                       [](Peer& peer) { peer.refuse(v1::ERROR_BUSY, "too many clients"); },
                       [](Peer& peer) { (void)peer.request(); },  // ends without an answer
                       [](Peer& peer) {
                         peer.greet();
                         (void)peer.ends_silently();
                       }});
  Client client(patient(daemon.options));
  EXPECT_THAT(next<Reconnected>(client).reason, HasSubstr("ended the connection"));
}

TEST(Reconnecting, WhatMoreAttemptsCannotFixIsThrown) {
  PlayedDaemon daemon({[](Peer& peer) { peer.greet(); },
                       [](Peer& peer) { peer.refuse(v1::ERROR_DENIED, "unknown token"); },
                       [](Peer& peer) { peer.refuse(v1::ERROR_VERSION, "version 2 only"); },
                       [](Peer& peer) {
                         peer.greet();
                         (void)peer.ends_silently();
                       }});
  Client client(patient(daemon.options));
  try {
    (void)client.next(kLong);
    ADD_FAILURE();
  } catch (const Refused& e) {
    EXPECT_TRUE(e.denied());
    EXPECT_STREQ(e.what(), "unknown token");
  }
  EXPECT_THROW((void)client.next(kLong), ProtocolError);
  // The third daemon accepts the token.
  (void)next<Reconnected>(client);
}

TEST(Reconnecting, OnlyWhenAskedFor) {
  PlayedDaemon daemon({[](Peer& peer) { peer.greet(); }});
  Client client(daemon.options);
  EXPECT_THROW((void)client.next(kLong), ConnectionError);
  EXPECT_THROW((void)client.next(kLong), ConnectionError);
}

TEST(Reconnecting, TheReasonOfADaemonThatLetsGoHasItsCode) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    peer.refuse(v1::ERROR_FLOOD, "more than 100 requests a second");
    v1::ServerMessage last;
    last.mutable_reply()->mutable_error()->set_code(v1::ERROR_BUSY);
    peer.send(last);
  }});
  Client client(daemon.options);
  try {
    (void)client.status();
    ADD_FAILURE();
  } catch (const EndedByDaemon& e) {
    EXPECT_EQ(e.code(), v1::ERROR_FLOOD);
    EXPECT_STREQ(e.what(), "more than 100 requests a second");
  }
  try {
    (void)client.next(kLong);
    ADD_FAILURE();
  } catch (const EndedByDaemon& e) {
    EXPECT_EQ(e.code(), v1::ERROR_BUSY);
  }
}

TEST(Waiting, RunCallsTheHandlers) {
  PlayedDaemon daemon({[](Peer& peer) {
                         peer.greet();
                         peer.frame(1);
                         v1::ServerMessage event;
                         event.mutable_event()->mutable_reference()->set_sequence(2);
                         peer.send(event);
                       },
                       [](Peer& peer) {
                         peer.greet();
                         peer.frame(3);
                         (void)peer.ends_silently();
                       }});
  Client client(patient(daemon.options));
  std::stop_source stop;
  std::vector<std::string> seen;
  Handlers handlers;
  handlers.frame = [&](const v1::Frame& frame) {
    seen.push_back("frame " + std::to_string(frame.sequence()));
    if (frame.sequence() == 3) stop.request_stop();
  };
  handlers.event = [&](const v1::Event& event) {
    seen.push_back("event " + std::to_string(event.reference().sequence()));
  };
  handlers.reconnected = [&](const Reconnected& gap) {
    seen.push_back("gap after " + std::to_string(gap.last_sequence));
  };
  client.run(handlers, stop.get_token());
  EXPECT_THAT(seen, ElementsAre("frame 1", "event 2", "gap after 1", "frame 3"));
}

// Without the stop these would wait for ten minutes and more.
TEST(Waiting, AStopEndsRunWhileNothingComes) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    (void)peer.ends_silently();
  }});
  Client client(daemon.options);
  std::jthread running([&client](const std::stop_token& stop) { client.run({}, stop); });
  std::this_thread::sleep_for(milliseconds(50));
}

TEST(Waiting, AStopEndsRunWhileItWaitsForTheNextAttempt) {
  PlayedDaemon daemon({[](Peer& peer) { peer.greet(); }});
  Options options = daemon.options;
  options.reconnect = Reconnect{std::chrono::minutes(30), std::chrono::minutes(30)};
  Client client(options);
  daemon.finish();
  std::jthread running([&client](const std::stop_token& stop) { client.run({}, stop); });
  std::this_thread::sleep_for(milliseconds(50));
}

TEST(Waiting, AStopEndsRunInTheMiddleOfAnAttempt) {
  PlayedDaemon daemon({[](Peer& peer) { peer.greet(); },
                       [](Peer& peer) {
                         (void)peer.request();
                         (void)peer.ends_silently();
                       }});
  Options options = patient(daemon.options);
  options.timeout = std::chrono::minutes(10);
  Client client(options);
  std::jthread running([&client](const std::stop_token& stop) { client.run({}, stop); });
  std::this_thread::sleep_for(milliseconds(100));
}

TEST(Waiting, RunSaysWhenTheConnectionIsLost) {
  PlayedDaemon daemon({[](Peer& peer) { peer.greet(); }});
  Client client(daemon.options);
  EXPECT_THROW(client.run({}, {}), ConnectionError);
}

TEST(Waiting, TheDescriptorReportsAnEventLoop) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    peer.done();
    peer.frame(1);
    peer.frame(2);
    (void)peer.ends_silently();
  }});
  Client client(daemon.options);
  client.subscribe();
  std::vector<std::uint64_t> seen;
  while (seen.size() < 2) {
    pollfd readable{client.native_handle(), POLLIN, 0};
    ASSERT_EQ(::poll(&readable, 1, 60'000), 1);
    while (const auto item = client.next(milliseconds(0))) {
      seen.push_back(std::get<v1::Frame>(*item).sequence());
    }
  }
  EXPECT_THAT(seen, ElementsAre(1, 2));
}

TEST(Waiting, APeerThatFallsSilentIsFound) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    (void)peer.ends_silently();
  }});
  const Client client(daemon.options);
  const auto option = [&client](int level, int name) {
    int value = 0;
    socklen_t size = sizeof value;
    ::getsockopt(client.native_handle(), level, name, &value, &size);
    return value;
  };
  EXPECT_EQ(option(SOL_SOCKET, SO_KEEPALIVE), 1);
  EXPECT_EQ(option(IPPROTO_TCP, TCP_KEEPIDLE), 5);
  EXPECT_EQ(option(IPPROTO_TCP, TCP_USER_TIMEOUT), 10'000);
}

TEST(SocketFile, IsAnAddressLikeAnother) {
  std::string name = (std::filesystem::temp_directory_path() / "dtact_unix_XXXXXX").string();
  ASSERT_NE(::mkdtemp(name.data()), nullptr);
  const std::filesystem::path folder = name;
  Options options;
  options.host = "unix:" + (folder / "dtactd.sock").string();
  options.timeout = kLong;
  options.token = "s3cret";
  try {
    const Client client(options);
    ADD_FAILURE() << "connected to nobody";
  } catch (const ConnectionError& e) {
    EXPECT_THAT(e.what(), HasSubstr("nothing listens on unix:"));
  }
  std::string token;
  {
    PlayedDaemon daemon({[&token](Peer& peer) {
                          token = peer.greet().token();
                          (void)peer.ends_silently();
                        }},
                        listen_on(folder / "dtactd.sock"));
    const Client client(options);
    EXPECT_TRUE(client.same_machine());
  }
  EXPECT_EQ(token, "s3cret");
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace dtact::client::test
