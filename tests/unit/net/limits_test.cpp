// What clients may use of the daemon, and how it treats those that want more.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <deque>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/serve/admission.hpp"
#include "daemon/serve/large_message.hpp"
#include "daemon/serve/limited_log.hpp"
#include "daemon/serve/session_list.hpp"
#include "daemon/serve/token_bucket.hpp"
#include "hal/base/atomic_file.hpp"
#include "proto/fingerprint.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using testing::HasSubstr;
using namespace std::string_literals;
using std::chrono::milliseconds;

TEST(TokenBucket, FillsUpToItsBurst) {
  const TokenBucket::Clock::time_point start;
  TokenBucket bucket(10, 3, start);
  EXPECT_TRUE(bucket.take(2, 0, start));
  EXPECT_TRUE(bucket.take(1, 0, start));
  EXPECT_FALSE(bucket.take(1, 0, start));
  EXPECT_FALSE(bucket.take(1, 0, start + milliseconds(99)));
  EXPECT_TRUE(bucket.take(1, 0, start + milliseconds(100)));
  EXPECT_TRUE(bucket.take(3, 0, start + std::chrono::hours(1)));
  EXPECT_FALSE(bucket.take(1, 0, start + std::chrono::hours(1)));
}

TEST(TokenBucket, KeepsAReserve) {
  const TokenBucket::Clock::time_point start;
  TokenBucket bucket(10, 5, start);
  EXPECT_TRUE(bucket.take(1, 4, start));
  EXPECT_FALSE(bucket.take(1, 4, start));
  EXPECT_TRUE(bucket.take(4, 0, start));
  EXPECT_FALSE(bucket.take(1, 4, start + milliseconds(499)));
  EXPECT_TRUE(bucket.take(1, 4, start + milliseconds(500)));
}

TEST(TokenBucket, ACostAboveTheBurstTakesAllOfIt) {
  const TokenBucket::Clock::time_point start;
  TokenBucket bucket(10, 3, start);
  EXPECT_TRUE(bucket.take(7, 0, start));
  EXPECT_FALSE(bucket.take(1, 0, start));
  EXPECT_FALSE(bucket.take(7, 0, start + milliseconds(299)));
  EXPECT_TRUE(bucket.take(7, 0, start + milliseconds(301)));
  // All but the reserve.
  TokenBucket reserved(10, 3, start);
  EXPECT_TRUE(reserved.take(7, 1, start));
  EXPECT_FALSE(reserved.take(1, 1, start));
  EXPECT_TRUE(reserved.take(1, 0, start));
  EXPECT_FALSE(reserved.take(1, 0, start));
}

TEST(Admission, GivesEachAddressItsHandshakes) {
  int lines = 0;
  NetConfig config;
  config.log = [&](const LogLine& line) {
    ++lines;
    EXPECT_EQ(line.subject, LogSubject::unauthenticated);
    EXPECT_THAT(line.text, HasSubstr("10.0.0.7:1: more than 100 TLS handshakes a second came"));
  };
  Admission admission(config);
  const Peer greedy{"10.0.0.7:1", "", "10.0.0.7", false};
  const auto began = TokenBucket::Clock::now();
  int taken = 0;
  for (int i = 0; i < 1000; ++i) taken += admission.take_handshake(greedy) ? 1 : 0;
  const std::chrono::duration<double> took = TokenBucket::Clock::now() - began;
  EXPECT_GE(taken, 100);
  EXPECT_LE(taken, 101 + 100 * took.count());
  EXPECT_EQ(lines, 1000 - taken);
  EXPECT_TRUE(admission.take_handshake({"10.0.0.8:1", "", "10.0.0.8", false}));
}

// Before: the request was refused for ever.
TEST(TokenBucket, WhatCostsMoreThanThereCanBeTakesAll) {
  const TokenBucket::Clock::time_point start;
  TokenBucket bucket(10, 5, start);
  EXPECT_TRUE(bucket.take(9, 2, start));
  EXPECT_FALSE(bucket.take(1, 2, start));
  EXPECT_TRUE(bucket.take(2, 0, start));
  EXPECT_FALSE(bucket.take(9, 0, start + milliseconds(499)));
  EXPECT_TRUE(bucket.take(9, 0, start + milliseconds(500)));
}

TEST(LimitedLog, SaysHowManyLinesItLeftOut) {
  std::vector<std::string> lines;
  const Log log = limited([&lines](const LogLine& line) { lines.push_back(line.text); });
  for (int i = 0; i < 5000; ++i) log({LogLevel::info, "x"});
  // 100, and as many as became allowed meanwhile. The count of the last dropped lines is still due.
  EXPECT_GE(lines.size(), 100U);
  EXPECT_LT(lines.size(), 5000U);
  EXPECT_EQ(lines.front(), "x");
}

// Before: a light scheme with a line break in it made a second line, of 60 kB.
TEST(LimitedLog, WordsOfAClientMakeNoLineOfTheirOwn) {
  std::vector<std::string> lines;
  const Log log = limited([&lines](const LogLine& line) { lines.push_back(line.text); });
  log({LogLevel::info, "scheme \"a\n[info] all is well\x1b[2J\u009b2Jé\": unknown"});
  log({LogLevel::info, std::string(60'000, 'x')});
  EXPECT_EQ(lines[0], "scheme \"a?[info] all is well?[2J?2Jé\": unknown");
  EXPECT_EQ(lines[1], std::string(kMaxLogLine, 'x'));
}

TEST(LimitedLog, RefusedCommandsDisplaceNoChanges) {
  std::vector<std::string> lines;
  const Log log = limited([&lines](const LogLine& line) { lines.push_back(line.text); });
  for (int i = 0; i < 5000; ++i) log({LogLevel::info, "denied", "", LogSubject::denied});
  EXPECT_LT(lines.size(), 1000U);
  lines.clear();
  for (int i = 0; i < 1000; ++i) log({LogLevel::info, "light set", "", LogSubject::change});
  EXPECT_EQ(lines.size(), 1000U);
}

TEST(LimitedLog, UnauthenticatedClientsDisplaceNobodyElsesLines) {
  std::vector<std::string> lines;
  const Log log = limited([&lines](const LogLine& line) { lines.push_back(line.text); });
  for (int i = 0; i < 5000; ++i) log({LogLevel::warning, "x", "", LogSubject::unauthenticated});
  lines.clear();
  log({LogLevel::info, "somebody left"});
  for (int i = 0; i < 1000; ++i) {
    log({LogLevel::info, "light set", "", LogSubject::change});
  }
  EXPECT_EQ(lines.size(), 1001U);
}

// NOLINTBEGIN(misc-const-correctness): clang-tidy 19 takes clients that send for constants
TEST(BeforeHello, TakesAKilobyteAndNoMore) {
  const Rig rig;
  RawClient longest(rig.tcp_port());
  longest.send_bytes("\0\0\4\0"s + std::string(1024, '\xff'));
  EXPECT_EQ(longest.reply().error().code(), v1::ERROR_BAD_MESSAGE);
  RawClient longer(rig.tcp_port());
  longer.send_bytes("\0\0\4\1"s);
  const auto reply = longer.reply();
  EXPECT_EQ(reply.error().code(), v1::ERROR_TOO_LARGE);
  EXPECT_THAT(reply.error().message(),
              HasSubstr("1025 bytes was announced, at most 1024 are allowed before Hello"));
  EXPECT_TRUE(longer.ends());
}

/// A connection from `host` that sends nothing. `closed` is set when it is closed.
class SilentTransport : public Transport {
 public:
  SilentTransport(boost::asio::io_context& io, const std::string& host, bool& closed)
      : Transport({host + ":4711", "127.0.0.1:7377", host, false}), io_(io), closed_(closed) {}

  void handshake(std::function<void(const boost::system::error_code&)>) override {}
  void read_some(boost::asio::mutable_buffer, Done) override {}
  void write(const Parts&, Done) override {}
  void shutdown_send(std::shared_ptr<void>) override {}
  void close() override { closed_ = true; }
  boost::asio::any_io_executor executor() override { return io_.get_executor(); }

 private:
  boost::asio::io_context& io_;
  bool& closed_;
};

/// Connections that have not said Hello, with the host that each came from.
class BeforeHelloList : public ::testing::Test {
 protected:
  void connect(const std::string& host) {
    list_.admit(std::make_shared<Session>(
        std::make_unique<SilentTransport>(io_, host, closed.emplace_back()), config_, admission_,
        std::weak_ptr<SessionHost>()));
  }
  std::deque<bool> closed;  ///< In the order of connect().

 private:
  boost::asio::io_context io_;
  NetConfig config_;
  Admission admission_{config_};
  SessionList list_;
};

TEST_F(BeforeHelloList, AFloodFromOneAddressLeavesRoomForOthers) {
  connect("192.0.2.1");
  for (std::size_t i = 0; i < 3 * SessionList::kMaxUnauthenticated; ++i) connect("192.0.2.2");
  connect("192.0.2.3");
  EXPECT_FALSE(closed.front()) << "it came before";
  EXPECT_FALSE(closed.back()) << "it came after";
  EXPECT_TRUE(closed[1]);
  EXPECT_FALSE(closed[closed.size() - 2]);
}

TEST_F(BeforeHelloList, AFloodFromEverywhereTakesTheOldestOnesPlace) {
  for (std::size_t i = 0; i <= SessionList::kMaxUnauthenticated; ++i) {
    connect("192.0.2." + std::to_string(i));
  }
  EXPECT_TRUE(closed[0]);
  EXPECT_EQ(std::ranges::count(closed, true), 1);
}

TEST(BeforeHello, AFloodOfConnectionsLeavesRoomForThoseThatSayHello) {
  const Rig rig;
  std::vector<std::unique_ptr<RawClient>> flood;
  for (std::size_t i = 0; i < 3 * SessionList::kMaxUnauthenticated; ++i) {
    flood.push_back(std::make_unique<RawClient>(rig.tcp_port()));
  }
  EXPECT_TRUE(flood.front()->ends());
  EXPECT_NO_THROW(flood.back()->hello());
}

TEST(Admission, CountsClientsOfEachAddress) {
  NetConfig config;
  config.max_clients_per_address = 2;
  Rig rig(config);
  RawClient a(rig.tcp_port());
  auto b = std::make_unique<RawClient>(rig.tcp_port());
  a.hello();
  b->hello();
  RawClient c(rig.tcp_port());
  const auto reply = c.say_hello();
  EXPECT_EQ(reply.error().code(), v1::ERROR_BUSY);
  EXPECT_THAT(reply.error().message(), HasSubstr("2 clients are connected from this machine"));
  EXPECT_TRUE(c.ends());
  // Any program may take any of the sixteen million loopback addresses.
  RawClient other{connected_from("127.8.0.2", rig.tcp_port())};
  EXPECT_EQ(other.say_hello().error().code(), v1::ERROR_BUSY);
  b.reset();
  ASSERT_TRUE(rig.wait_log("the client left"));
  RawClient d(rig.tcp_port());
  EXPECT_NO_THROW(d.hello());
}

TEST(Admission, KeepsPlacesForThoseThatNeedNoToken) {
  NetConfig config;
  config.max_clients = 3;
  Admission admission(config);
  const Peer other{"192.0.2.1:4711", "0.0.0.0:7377", "192.0.2.1", false};
  const Peer root{"pid 811 (uid 0)", "/run/dtactd/dtactd.sock", "uid 0 (needs no token)", true};
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(admission.enter(other, "").grant->rights, Rights::calibrate);
  EXPECT_EQ(admission.enter(other, "").error_code, v1::ERROR_BUSY);
  for (std::size_t i = 0; i < Admission::kReserved; ++i) {
    EXPECT_EQ(admission.enter(root, "").grant->rights, Rights::calibrate) << i;
  }
  EXPECT_EQ(admission.enter(root, "").error_code, v1::ERROR_BUSY);
  admission.leave(root);
  EXPECT_EQ(admission.enter(other, "").error_code, v1::ERROR_BUSY);
  EXPECT_EQ(admission.enter(root, "").grant->rights, Rights::calibrate);
}

TEST(Requests, TooManyASecondAreAFlood) {
  NetConfig config;
  config.max_requests_per_s = 20;
  const Rig rig(config);
  RawClient client(rig.tcp_port());
  client.hello();
  RawClient other(rig.tcp_port());
  other.hello();
  auto request = get_status();
  for (std::uint64_t id = 100; id < 5000; ++id) {
    request.set_id(id);
    client.send(request);
  }
  v1::Reply reply;
  int served = 0;
  do {
    reply = client.reply();
    served += reply.has_status() ? 1 : 0;
  } while (reply.has_status());
  EXPECT_GE(served, 19);
  EXPECT_EQ(reply.error().code(), v1::ERROR_FLOOD);
  EXPECT_THAT(reply.error().message(), HasSubstr("more than 20 requests a second came"));
  EXPECT_TRUE(client.ends());
  EXPECT_TRUE(other.request(get_status()).has_status());
}

// Before: with so few requests a second no calibration could be uploaded.
TEST(Requests, ALargeOneCountsAsManyAndIsTaken) {
  NetConfig config;
  config.max_requests_per_s = 5;
  const Rig rig(config, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  auto& upload = *message.mutable_upload_calibration();
  upload.set_name("large");
  upload.set_calibration_toml("toml");
  upload.set_reference_png(std::string(21U << 16U, 'x'));
  std::this_thread::sleep_for(std::chrono::milliseconds(250));  // Hello's share is back
  EXPECT_TRUE(client.request(message).has_done());
  auto status = get_status();
  for (std::uint64_t id = 100; id < 200; ++id) {
    status.set_id(id);
    client.send(status);
  }
  v1::Reply reply;
  do {
    reply = client.reply();
  } while (reply.has_status());
  EXPECT_EQ(reply.error().code(), v1::ERROR_FLOOD);
}

/// The answer to the largest messages, parsed or not.
TEST(Incoming, OnlyAPlainUploadMayBeLarge) {
  const std::string png(100'000, 'x');
  v1::ClientMessage upload;
  upload.set_id(7);
  upload.mutable_upload_calibration()->set_name("large");
  upload.mutable_upload_calibration()->set_reference_png(png);
  const std::string whole = upload.SerializeAsString();
  EXPECT_TRUE(is_plain_upload(whole));
  EXPECT_FALSE(is_plain_upload(whole.substr(0, whole.size() - 1)));
  // Only few fields of later versions are allowed.
  const std::string unknown = "\xf8\x01\x01"s;
  const auto times = [](int n, const std::string& text) {
    std::string all;
    for (int i = 0; i < n; ++i) all += text;
    return all;
  };
  EXPECT_TRUE(is_plain_upload(whole + times(14, unknown)));
  EXPECT_FALSE(is_plain_upload(whole + times(15, unknown)));
  EXPECT_FALSE(is_plain_upload(whole + times(20, unknown)));
  EXPECT_FALSE(is_plain_upload(times(40'000, unknown)));
  v1::ClientMessage behalf = upload;
  behalf.set_on_behalf_of(std::string(256, 'w'));
  EXPECT_TRUE(is_plain_upload(behalf.SerializeAsString()));
  behalf.set_on_behalf_of(std::string(257, 'w'));
  EXPECT_FALSE(is_plain_upload(behalf.SerializeAsString()));
  EXPECT_FALSE(is_plain_upload(whole + "\xfb\x01\xfc\x01"s)) << "a group may hold any number";
  v1::ClientMessage leds;
  leds.set_id(8);
  for (int i = 0; i < 40'000; ++i) leds.mutable_set_light()->add_leds();
  EXPECT_FALSE(is_plain_upload(leds.SerializeAsString()));
  EXPECT_FALSE(is_plain_upload(whole + leds.SerializeAsString()));
  // The same within the upload.
  std::string inside = upload.upload_calibration().SerializeAsString() + times(20, unknown);
  const std::size_t size = inside.size();
  inside = "\x42"s + static_cast<char>((size & 0x7fU) | 0x80U) +
           static_cast<char>((size >> 7U & 0x7fU) | 0x80U) + static_cast<char>(size >> 14U) +
           inside;
  EXPECT_FALSE(is_plain_upload(inside));
}

TEST(Incoming, ALargeRequestOfManyPartsIsNotTakenApart) {
  const Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  for (int i = 0; i < 40'000; ++i) message.mutable_set_light()->add_leds();
  const auto reply = client.request(message);
  EXPECT_EQ(reply.id(), 0U);
  EXPECT_EQ(reply.error().code(), v1::ERROR_TOO_LARGE);
  EXPECT_THAT(reply.error().message(),
              HasSubstr("only upload_calibration may have more than 65536"));
  EXPECT_TRUE(client.ends());
}

// Before: while two kept half an upload each, every other upload was refused.
TEST(Incoming, HalfUploadsLockNobodyOut) {
  Rig rig;
  // The last byte of sixteen mebibytes is missing. Memory at most doubles, so each takes all of it.
  const std::string part = "\1\0\0\0"s + std::string((16U << 20U) - 1, 'x');
  std::vector<std::unique_ptr<RawClient>> greedy;
  for (int i = 0; i < 2; ++i) {
    greedy.push_back(std::make_unique<RawClient>(rig.tcp_port()));
    greedy.back()->hello();
    greedy.back()->send_bytes(part);
  }
  RawClient honest(rig.tcp_port());
  honest.hello();
  v1::ClientMessage message;
  auto& upload = *message.mutable_upload_calibration();
  upload.set_name("!");
  upload.set_reference_png(std::string(1U << 20U, 'x'));
  EXPECT_EQ(honest.request(message).error().code(), v1::ERROR_INVALID) << "read to its end";
  // Either may have been read first.
  std::vector<pollfd> polled;
  for (const auto& client : greedy) polled.push_back({client->descriptor(), POLLIN, 0});
  ASSERT_EQ(::poll(polled.data(), polled.size(), 60'000), 1);
  EXPECT_TRUE(rig.wait_log("the large messages of all clients took too much memory"));
  // The other one goes on.
  RawClient& other = *greedy[polled[0].revents != 0 ? 1 : 0];
  other.send_bytes("x");
  EXPECT_EQ(other.reply().error().code(), v1::ERROR_TOO_LARGE);
}

// Two of them would take all the room.
TEST(Incoming, ABrokenOffUploadGivesItsRoomBack) {
  Rig rig;
  const std::string part = "\1\0\0\0"s + std::string((16U << 20U) - 1, 'x');
  for (int i = 0; i < 3; ++i) {
    {
      RawClient leaves(rig.tcp_port());
      leaves.hello();
      leaves.send_bytes(part);
    }
    const auto end = std::chrono::steady_clock::now() + kTimeout;
    while (rig.overview().status.clients_size() > 0) {
      ASSERT_LT(std::chrono::steady_clock::now(), end);
      std::this_thread::sleep_for(milliseconds(1));
    }
  }
  RawClient next(rig.tcp_port());
  next.hello();
  next.send_bytes(part);
  next.send_bytes("x");
  // It is read to its end and then found not to be an upload.
  EXPECT_EQ(next.reply().error().code(), v1::ERROR_TOO_LARGE);
}

TEST(Held, TheLargestOfTheGreediestAddressIsGivenUp) {
  constexpr std::size_t kMiB = std::size_t{1} << 20U;
  const NetConfig config;
  Admission admission(config);
  std::vector<int> gone;
  const std::vector<int> clients{0, 1, 2, 3};
  const auto hold = [&](std::size_t client, const std::string& host, std::size_t bytes) {
    admission.hold(&clients[client], host, bytes,
                   [&gone, client] { gone.push_back(static_cast<int>(client)); });
  };
  hold(0, "192.0.2.1", 15 * kMiB);
  hold(1, "192.0.2.2", 9 * kMiB);
  hold(2, "192.0.2.2", 8 * kMiB);
  EXPECT_TRUE(gone.empty());
  hold(3, "192.0.2.3", kMiB);
  EXPECT_EQ(gone, std::vector{1});
  // What is held no more is room again.
  hold(0, "192.0.2.1", 0);
  hold(1, "192.0.2.2", 16 * kMiB);
  EXPECT_EQ(gone.size(), 1U);
  // Who asks is not given up while there is another.
  hold(1, "192.0.2.2", 32 * kMiB);
  EXPECT_EQ(gone, (std::vector{1, 2, 3}));
}

TEST(Held, LargeAnswersThatNobodyReadsAreBounded) {
  Rig rig;
  const CalibrationFiles large{
      .name = "large", .toml = "toml", .png = std::string(15U << 20U, 'x')};
  const std::uint64_t number = rig.store.keep(large).number;
  v1::ClientMessage ask;
  ask.mutable_get_calibration()->set_number(number);
  std::vector<std::unique_ptr<RawClient>> silent;
  for (int i = 0; i < 6; ++i) {
    silent.push_back(std::make_unique<RawClient>(rig.tcp_port(), 4096));
    silent.back()->hello();
    ask.set_id(7);
    silent.back()->send(ask);
  }
  RawClient reader(rig.tcp_port());
  reader.hello();
  EXPECT_EQ(reader.request(ask).calibration().reference_png().size(), 15U << 20U);
  EXPECT_TRUE(rig.wait_log("the large messages of all clients took too much memory"));
  std::size_t waiting = 0;
  const v1::Status status = rig.overview().status;
  for (const auto& client : status.clients()) waiting += client.waiting_bytes();
  EXPECT_LE(waiting, Admission::kMaxHeld);
}

TEST(WrongTokens, AreAnsweredLaterAndLater) {
  using namespace std::chrono_literals;
  const calibration::TempFolder folder;
  NetConfig config;
  config.token_file = folder.path() / "tokens";
  base::write_file_atomically(
      config.token_file,
      "control " + wire::token_hash("0123456789abcdef0123456789abcdef") + " arm\n", 0600);
  Admission admission(config);
  const Peer guesser{"192.0.2.1:4711", "0.0.0.0:7377", "192.0.2.1", false};
  const Peer other{"192.0.2.2:4711", "0.0.0.0:7377", "192.0.2.2", false};
  std::vector<milliseconds> delays;
  for (int i = 0; i < 8; ++i) {
    const auto verdict = admission.enter(guesser, "guess");
    EXPECT_EQ(verdict.error_code, v1::ERROR_DENIED);
    delays.push_back(verdict.delay);
  }
  EXPECT_EQ(delays, (std::vector<milliseconds>{500ms, 1s, 2s, 4s, 8s, 16s, 16s, 16s}));
  EXPECT_EQ(admission.enter(other, "guess").delay, 500ms);
  EXPECT_EQ(admission.enter(guesser, "").delay, 500ms) << "none is no guess";
  // A client that shares the address with a guesser is served at once.
  EXPECT_EQ(admission.enter(guesser, "0123456789abcdef0123456789abcdef").grant->rights,
            Rights::control);
}

// Of 1024 addresses the wrong tokens are remembered; the one that is heard of no more goes first.
TEST(WrongTokens, AreRememberedOfSoManyAddresses) {
  using namespace std::chrono_literals;
  const calibration::TempFolder folder;
  NetConfig config;
  config.token_file = folder.path() / "tokens";
  base::write_file_atomically(config.token_file,
                              "view " + wire::token_hash("0123456789abcdef0123456789abcdef") + "\n",
                              0600);
  Admission admission(config);
  const auto guess = [&](int host) {
    const std::string address = "2001:db8::" + std::to_string(host);
    return admission.enter({"[" + address + "]:4711", "[::]:7377", address, false}, "guess").delay;
  };
  EXPECT_EQ(guess(0), 500ms);
  for (int host = 1; host <= 1023; ++host) EXPECT_EQ(guess(host), 500ms) << host;
  EXPECT_EQ(guess(0), 1s) << "there was room for all";
  EXPECT_EQ(guess(1024), 500ms);
  EXPECT_EQ(guess(0), 2s);
  EXPECT_EQ(guess(2), 1s);
  EXPECT_EQ(guess(1), 500ms) << "it had lost its place";
}

TEST(Answers, AboveTheCapAreErrorsAndTheConnectionStays) {
  Rig rig;
  CalibrationFiles huge{.name = "huge", .toml = "toml", .png = std::string(17U << 20U, 'x')};
  const std::uint64_t number = rig.store.keep(huge).number;
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  message.mutable_get_calibration()->set_number(number);
  const auto reply = client.request(message);
  EXPECT_EQ(reply.error().code(), v1::ERROR_TOO_LARGE);
  EXPECT_THAT(reply.error().message(), HasSubstr("the answer has 178258"));
  EXPECT_TRUE(client.request(get_status()).has_status());
}
// NOLINTEND(misc-const-correctness)

}  // namespace
}  // namespace dtact::net::test
