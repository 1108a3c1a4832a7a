#include "clients/dds/dds.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <future>
#include <iostream>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "clients/dds/graph.hpp"
#include "clients/dds/ros2.h"
#include "clients/dds/sensor.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/base/unique_fd.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/client/played_daemon.hpp"
#include "tests/unit/dds/graph_fixture.hpp"
#include "tests/unit/web/no_descriptors.hpp"

namespace dtact::dds {
namespace {

using client::test::Peer;
using client::test::PlayedDaemon;

template <typename Done>
bool within(std::chrono::seconds limit, Done done) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

std::int64_t steady_now() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

TEST(Interface, IsAnAddressOrAName) {
  for (const char* one : {"192.0.2.7", "2001:db8::1", "::1"}) EXPECT_TRUE(is_address(one)) << one;
  for (const char* one : {"eth0", "eth0.100", "eth0:1", "", "192.0.2"}) {
    EXPECT_FALSE(is_address(one)) << one;
  }
}

/// Makes a network whose only interface, loopback, is down, and then sets it up. Returns 0 when
/// addresses_of() has its address only then.
int addresses_are_those_of_interfaces_that_are_up() {
  constexpr int kNoNamespace = 77;
  if (::unshare(CLONE_NEWNET) != 0 && ::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) {
    return kNoNamespace;
  }
  const base::UniqueFd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq request{};
  std::strcpy(request.ifr_name, "lo");
  sockaddr_in address{};
  address.sin_family = AF_INET;
  ::inet_pton(AF_INET, "192.0.2.7", &address.sin_addr);
  std::memcpy(&request.ifr_addr, &address, sizeof address);
  if (::ioctl(socket.get(), SIOCSIFADDR, &request) != 0) return kNoNamespace;
  const std::vector<std::string> none;
  if (addresses_of({"lo"}) != none || addresses_of({"192.0.2.7"}) != none) return 1;
  request = {};
  std::strcpy(request.ifr_name, "lo");
  request.ifr_flags = IFF_UP;
  if (::ioctl(socket.get(), SIOCSIFFLAGS, &request) != 0) return kNoNamespace;
  // Loopback then has 127.0.0.1, too.
  if (std::ranges::count(addresses_of({"eth0", "lo"}), "192.0.2.7") != 1) return 2;
  if (addresses_of({"eth0", "192.0.2.7"}) != std::vector<std::string>{"192.0.2.7"}) return 3;
  if (addresses_of({"eth0", "192.0.2.8"}) != none) return 4;
  if (own_addresses() != std::vector<std::string>{"127.0.0.1"}) return 5;
  return 0;
}

// The bridge waits for an interface that is down to come up, rather than to begin on it.
TEST(Interface, HasAddressesWhileItIsUp) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto ends = [](int status) {
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    if (code != 0) std::cerr << "it ended with " << code;
    return code == 0 || code == 77;  // no namespace can be made here
  };
  EXPECT_EXIT(std::_Exit(addresses_are_those_of_interfaces_that_are_up()), ends, "");
}

// Before: it did not wait, so that a program without commands took a whole core.
TEST_F(Dds, WaitsForCommandsAlsoWhereNoneAreTaken) {
  const auto start = std::chrono::steady_clock::now();
  graph->wait(std::chrono::milliseconds(50));
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(49));
}

// Before: the newest 100, and nobody learned that others were lost.
TEST_F(Dds, KeepsMessagesWhileTheDiskIsBusy) {
  const std::size_t node = graph->add_node("/left", "dtact");
  const dds_entity_t writer =
      graph->add_writer(node, "/left/led/result", dtact_msgs_msg_dds__Result__desc, Qos::command);
  const dds_entity_t reader = subscribe("/left/led/result");
  std::vector<std::uint64_t> ids;
  const auto take_all = [&] {
    return take<dtact_msgs_msg_dds__Result_>(reader, dtact_msgs_msg_dds__Result__desc, 2000,
                                             [&](const auto& one) { ids.push_back(one.id); });
  };
  for (std::uint64_t id = 0; id < 500; ++id) write_result(writer, id, "");
  EXPECT_EQ(take_all(), 500U);
  EXPECT_EQ(ids.front(), 0U);
  EXPECT_EQ(ids.back(), 499U);
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t id = 0; id < 1200; ++id) write_result(writer, id, "");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10)) << "waits for none";
  dds_sample_rejected_status_t status{};
  ASSERT_EQ(dds_get_sample_rejected_status(reader, &status), DDS_RETCODE_OK);
  EXPECT_EQ(status.total_count, 200U);
  EXPECT_EQ(take_all(), 1000U);
  EXPECT_EQ(ids.back(), 999U) << "the oldest are kept";
}

TEST_F(Dds, ASensorThatFailsLeavesNothingOnTheGraph) {
  if (web::test::kNeedsDescriptors) GTEST_SKIP() << "the sanitizer needs descriptors";
  client::Options away;
  away.host = "unix:/no/such/socket";
  {
    const web::test::NoDescriptors none;
    EXPECT_THROW(add_sensor(away), std::exception);
  }
  EXPECT_FALSE(graph->published().empty());
  graph->keep_nodes(0);
  EXPECT_EQ(graph->nodes(), 0U);
  EXPECT_TRUE(graph->published().empty());
  add_sensor(away);
  graph->announce();
  EXPECT_EQ(graph->nodes(), 1U);
  sensor.reset();
}

// Before: the answer to the first ping counted as that to the second, with an error of nearly 0.
TEST_F(Dds, APongIsThatOfItsOwnPing) {
  std::atomic<bool> answered = false;
  PlayedDaemon daemon({[&](Peer& peer) {
    peer.greet();
    v1::ServerMessage pong;
    for (int pings = 0; pings < 2;) {
      const v1::ClientMessage request = peer.request();
      if (!request.has_ping() || ++pings > 1) continue;
      pong.mutable_reply()->set_id(request.id());
      pong.mutable_reply()->mutable_pong()->set_monotonic_ns(steady_now());
      pong.mutable_reply()->mutable_pong()->set_wall_ns(ros_now());
    }
    peer.send(pong);
    answered = true;
    for (;;) (void)peer.request();
  }});
  add_sensor(daemon.options);
  const dds_entity_t reader = subscribe("/left/clock_mapping");
  ASSERT_TRUE(within(client::test::kLong, [&] { return there.load(); }));
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  sensor->each_second(false);
  ASSERT_TRUE(within(client::test::kLong, [&] { return answered.load(); }));
  std::optional<dtact_msgs_msg_dds__ClockMapping_> mapping;
  for (int i = 0; i < 10 && !mapping; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    sensor->each_second(false);
    take<dtact_msgs_msg_dds__ClockMapping_>(reader, dtact_msgs_msg_dds__ClockMapping__desc, 1,
                                            [&](const auto& one) { mapping = one; });
  }
  ASSERT_TRUE(mapping);
  EXPECT_LE(std::abs(mapping->offset_ns - (ros_now() - steady_now())),
            mapping->error_ns + 1'000'000);
  sensor.reset();
}

// Before: the daemon ended the connection, for text that is not UTF-8 or for its length.
TEST_F(Dds, ANameFromTheGraphBecomesPrintable) {
  std::promise<std::string> scheme;
  std::promise<std::string> resolution;
  PlayedDaemon daemon({[&](Peer& peer) {
    peer.greet();
    for (;;) {
      const v1::ClientMessage request = peer.request();
      if (request.has_set_light()) scheme.set_value(request.set_light().scheme());
      if (request.has_set_reconstruction()) {
        resolution.set_value(request.set_reconstruction().resolution());
      }
    }
  }});
  Settings settings;
  settings.commands = true;
  add_sensor(daemon.options, settings);
  ASSERT_TRUE(within(client::test::kLong, [&] { return there.load(); }));
  const std::size_t node = graph->add_node("/test", "test");
  const dds_entity_t led_writer =
      graph->add_writer(node, "/left/led", dtact_msgs_msg_dds__Led__desc, Qos::command);
  const dds_entity_t resolution_writer = graph->add_writer(
      node, "/left/resolution", dtact_msgs_msg_dds__Resolution__desc, Qos::command);
  std::string bad = "\xff\n\xc3\xa4!";
  dtact_msgs_msg_dds__Led_ led{};
  led.brightness = -1;
  led.scheme = bad.data();
  ASSERT_EQ(dds_write(led_writer, &led), DDS_RETCODE_OK);
  std::string long_one(100'000, 'x');
  dtact_msgs_msg_dds__Resolution_ wanted{};
  wanted.resolution = long_one.data();
  ASSERT_EQ(dds_write(resolution_writer, &wanted), DDS_RETCODE_OK);
  auto sent_scheme = scheme.get_future();
  auto sent_resolution = resolution.get_future();
  const auto came = [&](auto& future) {
    return within(std::chrono::seconds(20), [&] {
      sensor->take_commands();
      return future.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    });
  };
  ASSERT_TRUE(came(sent_scheme));
  EXPECT_EQ(sent_scheme.get(), std::string(4, '?') + '!');
  ASSERT_TRUE(came(sent_resolution));
  EXPECT_EQ(sent_resolution.get(), std::string(64, 'x'));
  sensor.reset();
}

/// A daemon that accepts lights and refuses re-zeros.
class Commanded {
 public:
  [[nodiscard]] const client::Options& options() const { return daemon_.options; }
  [[nodiscard]] std::vector<v1::ClientMessage> got() const {
    const std::scoped_lock lock(mutex_);
    return got_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<v1::ClientMessage> got_;
  PlayedDaemon daemon_{{[this](Peer& peer) {
    peer.greet();
    for (;;) {
      const v1::ClientMessage request = peer.request();
      if (!request.has_set_light() && !request.has_rezero()) continue;
      v1::ServerMessage answer;
      answer.mutable_reply()->set_id(request.id());
      if (request.has_rezero()) {
        answer.mutable_reply()->mutable_error()->set_message("there is contact");
      } else {
        answer.mutable_reply()->mutable_light();
      }
      {
        const std::scoped_lock lock(mutex_);
        got_.push_back(request);
      }
      peer.send(answer);
    }
  }}};
};

TEST_F(Dds, CommandsArePassedOnAndAnswered) {
  Commanded daemon;
  Settings settings;
  settings.commands = true;
  add_sensor(daemon.options(), settings);
  ASSERT_TRUE(within(client::test::kLong, [&] { return there.load(); }));
  const dds_entity_t led_results = subscribe("/left/led/result");
  const dds_entity_t rezero_results = subscribe("/left/rezero/result");
  const std::size_t node = graph->add_node("/test", "test");
  const dds_entity_t led_writer =
      graph->add_writer(node, "/left/led", dtact_msgs_msg_dds__Led__desc, Qos::command);
  const dds_entity_t rezero_writer =
      graph->add_writer(node, "/left/rezero", dtact_msgs_msg_dds__Rezero__desc, Qos::command);
  const auto write_led = [&](std::uint64_t id, int brightness, const char* scheme,
                             std::vector<std_msgs_msg_dds__ColorRGBA_> leds) {
    dtact_msgs_msg_dds__Led_ led{};
    led.id = id;
    led.brightness = brightness;
    led.scheme = const_cast<char*>(scheme);
    led.leds._length = led.leds._maximum = static_cast<std::uint32_t>(leds.size());
    led.leds._buffer = leds.data();
    ASSERT_EQ(dds_write(led_writer, &led), DDS_RETCODE_OK);
  };
  // The last of these are out of range, for which the daemon has a sentence.
  write_led(7, -1, "", {{0, 0.5F, 1, 0}, {1.01F, -0.01F, std::nanf(""), 1}});
  write_led(8, 0, "scheme2", {});
  write_led(9, -2, "", std::vector<std_msgs_msg_dds__ColorRGBA_>(300));
  const dtact_msgs_msg_dds__Rezero_ rezero{11, true};
  ASSERT_EQ(dds_write(rezero_writer, &rezero), DDS_RETCODE_OK);
  ASSERT_TRUE(within(client::test::kLong, [&] {
    sensor->take_commands();
    return daemon.got().size() == 4;
  }));
  const auto got = daemon.got();
  for (const auto& one : got) EXPECT_EQ(one.on_behalf_of(), "ROS 2");
  EXPECT_EQ(got[0].set_light().ShortDebugString(),
            "leds { g: 128 b: 255 } leds { r: 256 g: 256 b: 256 }");
  EXPECT_EQ(got[1].set_light().ShortDebugString(), "brightness: 0 scheme: \"scheme2\"");
  EXPECT_EQ(got[2].set_light().brightness(), 4294967294U);
  EXPECT_EQ(got[2].set_light().leds_size(), 256) << "no more than a request may have";
  EXPECT_TRUE(got[3].rezero().force());
  std::vector<std::uint64_t> done;
  std::string refused;
  ASSERT_TRUE(within(client::test::kLong, [&] {
    take<dtact_msgs_msg_dds__Result_>(led_results, dtact_msgs_msg_dds__Result__desc, 9,
                                      [&](const auto& one) {
                                        EXPECT_TRUE(one.ok);
                                        EXPECT_STREQ(one.message, "");
                                        done.push_back(one.id);
                                      });
    take<dtact_msgs_msg_dds__Result_>(rezero_results, dtact_msgs_msg_dds__Result__desc, 9,
                                      [&](const auto& one) {
                                        EXPECT_FALSE(one.ok);
                                        EXPECT_EQ(one.id, 11U);
                                        refused = one.message;
                                      });
    return done.size() == 3 && !refused.empty();
  }));
  EXPECT_THAT(done, testing::ElementsAre(7, 8, 9));
  EXPECT_EQ(refused, "there is contact");
  sensor.reset();
}

// Before: the signal ended the program.
TEST_F(Dds, ALimitOnTheFilesSizeIsAnError) {
  graph.reset();  // a program has one for each domain
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const std::string file = fakes::own_path(".mcap").string();
  const auto record = [&] {
    const rlimit limit{4096, 4096};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    return run({"--host", "unix:/no/such/socket", "--domain", std::to_string(domain), "--record",
                file, "--force", "--seconds", "0.1"},
               std::cout, std::cerr);
  };
  EXPECT_EXIT(std::exit(record()), testing::ExitedWithCode(1), "File too large");
  std::filesystem::remove(file);
}

// Before: --force emptied the earlier recording at once.
TEST_F(Dds, ARecordingWithoutASensorLeavesTheEarlierOne) {
  graph.reset();
  const std::string file = fakes::own_path(".mcap").string();
  base::write_file_atomically(file, "earlier");
  std::ostringstream out;
  std::ostringstream error;
  EXPECT_EQ(run({"--host", "unix:/no/such/socket", "--domain", std::to_string(domain), "--record",
                 file, "--force", "--seconds", "0.1"},
                out, error),
            1);
  EXPECT_NE(error.str().find("no message of a sensor came"), std::string::npos) << error.str();
  EXPECT_EQ(base::read_file(file), "earlier");
  EXPECT_FALSE(std::filesystem::exists(file + ".part"));
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace dtact::dds
