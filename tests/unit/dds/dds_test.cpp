#include "clients/dds/dds.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <future>
#include <iostream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "clients/dds/graph.hpp"
#include "clients/dds/messages.hpp"
#include "clients/dds/ros2.h"
#include "clients/dds/sensor.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/client/played_daemon.hpp"
#include "tests/unit/web/no_descriptors.hpp"

namespace dtact::dds {
namespace {

using client::test::Peer;
using client::test::PlayedDaemon;

/// Takes up to `most` messages.
template <typename Message, typename Take>
std::size_t take(dds_entity_t reader, const dds_topic_descriptor_t& type, std::size_t most,
                 Take taken) {
  for (std::size_t count = 0; count < most; ++count) {
    Message message{};
    void* to = &message;
    dds_sample_info_t info{};
    if (dds_take(reader, &to, &info, 1, 1) <= 0) return count;
    if (info.valid_data) taken(message);
    dds_sample_free(&message, &type, DDS_FREE_CONTENTS);
  }
  return most;
}

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

class Dds : public testing::Test {
 protected:
  void SetUp() override {
    // Below 102, where the ports are not those that systems give to others.
    domain = 20 + static_cast<std::uint32_t>(::getpid()) % 80;
    try {
      graph.emplace(Graph::Config{.domain = domain, .interfaces = {}, .peers = {}});
    } catch (const std::runtime_error& e) {
      GTEST_SKIP() << e.what();
    }
  }

  /// A sensor named left.
  Sensor& add_sensor(const client::Options& options, const Settings& settings = {}) {
    return sensor.emplace(*graph, cli::NamedDaemon{"left", options}, std::nullopt, settings,
                          [this](const std::string& line) {
                            if (line.starts_with("left is there")) there = true;
                          });
  }
  [[nodiscard]] dds_entity_t subscribe(const std::string& topic) const {
    const auto found = std::ranges::find(graph->published(), topic, &Graph::Published::topic);
    return graph->subscribe(*found, graph->make_waitset());
  }

  std::uint32_t domain = 0;
  std::optional<Graph> graph;
  std::atomic<bool> there = false;
  std::optional<Sensor> sensor;
};

TEST(Interface, IsAnAddressOrAName) {
  for (const char* one : {"192.0.2.7", "2001:db8::1", "::1"}) EXPECT_TRUE(is_address(one)) << one;
  for (const char* one : {"eth0", "eth0.100", "eth0:1", "", "192.0.2"}) {
    EXPECT_FALSE(is_address(one)) << one;
  }
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
