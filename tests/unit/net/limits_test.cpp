// What clients may use of the daemon, and how it treats those that want more.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/serve/admission.hpp"
#include "daemon/serve/large_message.hpp"
#include "daemon/serve/limited_log.hpp"
#include "daemon/serve/session_list.hpp"
#include "daemon/serve/token_bucket.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using testing::HasSubstr;
using namespace std::string_literals;
using std::chrono::milliseconds;

/// A connection from an address of this machine other than 127.0.0.1.
base::UniqueFd connected_from(const char* from, std::uint16_t port) {
  base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  ::inet_pton(AF_INET, from, &address.sin_addr);
  const auto* generic = reinterpret_cast<const sockaddr*>(&address);
  if (::bind(fd.get(), generic, sizeof address) != 0) throw std::runtime_error("cannot bind");
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  if (::connect(fd.get(), generic, sizeof address) != 0) throw std::runtime_error("cannot connect");
  return fd;
}

TEST(TokenBucket, FillsUpToItsBurst) {
  const TokenBucket::Clock::time_point start;
  TokenBucket bucket(10, 3, start);
  EXPECT_TRUE(bucket.take(2, start));
  EXPECT_TRUE(bucket.take(1, start));
  EXPECT_FALSE(bucket.take(1, start));
  EXPECT_FALSE(bucket.take(1, start + milliseconds(99)));
  EXPECT_TRUE(bucket.take(1, start + milliseconds(100)));
  EXPECT_FALSE(bucket.take(4, start + std::chrono::hours(1)));
  EXPECT_TRUE(bucket.take(3, start + std::chrono::hours(1)));
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

TEST(BeforeHello, AFloodLeavesRoomForOthers) {
  const Rig rig;
  std::vector<std::unique_ptr<RawClient>> flood;
  RawClient early{connected_from("127.0.0.2", rig.tcp_port())};
  for (std::size_t i = 0; i < 3 * SessionList::kMaxUnauthenticated; ++i) {
    flood.push_back(std::make_unique<RawClient>(rig.tcp_port()));
  }
  // An earlier client from another address keeps its connection.
  EXPECT_NO_THROW(early.hello());
  RawClient late(rig.tcp_port());
  EXPECT_NO_THROW(late.hello());
  EXPECT_TRUE(flood.front()->ends());
  EXPECT_NO_THROW(flood.back()->hello());
}

TEST(BeforeHello, AFloodFromEverywhereTakesTheOldestOnesPlace) {
  const Rig rig;
  RawClient oldest{connected_from("127.0.9.9", rig.tcp_port())};
  std::vector<std::unique_ptr<RawClient>> flood;
  for (std::size_t i = 0; i < SessionList::kMaxUnauthenticated; ++i) {
    const std::string from = "127.0.0." + std::to_string(i + 2);
    flood.push_back(std::make_unique<RawClient>(connected_from(from.c_str(), rig.tcp_port())));
  }
  EXPECT_TRUE(oldest.ends());
  for (auto& client : {flood.front().get(), flood[8].get()}) EXPECT_NO_THROW(client->hello());
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
  EXPECT_THAT(reply.error().message(), HasSubstr("2 clients are connected from 127.0.0.1"));
  EXPECT_TRUE(c.ends());
  RawClient other{connected_from("127.0.0.2", rig.tcp_port())};
  EXPECT_NO_THROW(other.hello());
  b.reset();
  ASSERT_TRUE(rig.wait_log("the client left"));
  RawClient d(rig.tcp_port());
  EXPECT_NO_THROW(d.hello());
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

TEST(Requests, ALargeOneCountsAsMany) {
  NetConfig config;
  config.max_requests_per_s = 20;
  const Rig rig(config, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  auto& upload = *message.mutable_upload_calibration();
  upload.set_name("large");
  upload.set_calibration_toml("toml");
  upload.set_reference_png(std::string(21U << 16U, 'x'));
  EXPECT_EQ(client.request(message).error().code(), v1::ERROR_FLOOD);
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
  EXPECT_FALSE(is_plain_upload(whole + times(20, unknown)));
  EXPECT_FALSE(is_plain_upload(times(40'000, unknown)));
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

TEST(Incoming, IsBoundedForAllClientsTogether) {
  const Rig rig;
  // The last byte of sixteen mebibytes is missing. Memory at most doubles, so each takes all of it.
  const std::string part = "\1\0\0\0"s + std::string((16U << 20U) - 1, 'x');
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 3; ++i) {
    clients.push_back(std::make_unique<RawClient>(rig.tcp_port()));
    clients.back()->hello();
    clients.back()->send_bytes(part);
  }
  // Any of the three may be read last.
  std::vector<pollfd> polled;
  for (const auto& client : clients) polled.push_back({client->descriptor(), POLLIN, 0});
  ASSERT_EQ(::poll(polled.data(), polled.size(), 60'000), 1);
  const auto refused =
      std::ranges::find_if(polled, [](const pollfd& p) { return p.revents != 0; }) - polled.begin();
  std::swap(clients[static_cast<std::size_t>(refused)], clients.back());
  const auto reply = clients.back()->reply();
  EXPECT_EQ(reply.error().code(), v1::ERROR_FLOOD);
  EXPECT_THAT(reply.error().message(), HasSubstr("33554432 bytes"));
  EXPECT_TRUE(clients.back()->ends());
  // Once a message is complete its room is free again.
  clients[0]->send_bytes("x");
  EXPECT_EQ(clients[0]->reply().error().code(), v1::ERROR_TOO_LARGE);
  RawClient next(rig.tcp_port());
  next.hello();
  next.send_bytes(part);
  next.send_bytes("x");
  EXPECT_EQ(next.reply().error().code(), v1::ERROR_TOO_LARGE);
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

TEST(Incoming, IsCountedOnceAndGivenBack) {
  NetConfig config;
  Admission admission(config);
  constexpr std::size_t kAll = Admission::kMaxIncoming;
  EXPECT_TRUE(admission.hold(0, kAll));
  EXPECT_FALSE(admission.hold(0, 1));
  EXPECT_TRUE(admission.hold(1, 0));
  EXPECT_TRUE(admission.hold(kAll, 0));
  EXPECT_TRUE(admission.hold(0, kAll));
}

TEST(Answers, AboveTheCapAreErrorsAndTheConnectionStays) {
  Rig rig;
  CalibrationFiles huge{.name = "huge", .toml = "toml", .png = std::string(17U << 20U, 'x')};
  const std::uint64_t number = rig.store.keep(huge);
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
