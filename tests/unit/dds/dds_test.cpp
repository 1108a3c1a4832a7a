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
#include <unistd.h>

#include <algorithm>
#include <array>
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
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "clients/dds/graph.hpp"
#include "clients/dds/messages.hpp"
#include "clients/dds/ros2.h"
#include "clients/dds/sensor.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/base/unique_fd.hpp"
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

// Before: the newest 100, and nobody learned that others were lost.
// Before: it did not wait, so that a program without commands took a whole core.
TEST_F(Dds, WaitsForCommandsAlsoWhereNoneAreTaken) {
  const auto start = std::chrono::steady_clock::now();
  graph->wait(std::chrono::milliseconds(50));
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(49));
}

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

/// Both ends of a topic.
struct Topic {
  dds_entity_t writer;
  dds_entity_t reader;
};

/// Messages with all fields different, so that none stands for another.
class DdsMessages : public Dds {
 protected:
  Topic topic(const dds_topic_descriptor_t& type) {
    const dds_entity_t writer =
        graph->add_writer(graph->add_node("/test", "test"), "/test/one", type, Qos::command);
    return {writer, subscribe("/test/one")};
  }
  /// Takes the one message that there is.
  template <typename Message, typename Check>
  void check_one(const Topic& topic, const dds_topic_descriptor_t& type, Check check) {
    EXPECT_EQ(take<Message>(topic.reader, type, 2, check), 1U);
  }

  const Header header{3'000'000'007, "left_surface_optical"};
};

TEST_F(DdsMessages, TheMapsScaleAndCentre) {
  const auto& type = sensor_msgs_msg_dds__CameraInfo__desc;
  const Topic one = topic(type);
  v1::DepthMap map;
  map.set_width(500);
  map.set_height(401);
  map.set_mm_per_px(0.04);
  write_camera_info(one.writer, header, map);
  check_one<sensor_msgs_msg_dds__CameraInfo_>(one, type, [&](const auto& info) {
    EXPECT_EQ(info.header.stamp.sec, 3);
    EXPECT_EQ(info.header.stamp.nanosec, 7U);
    EXPECT_STREQ(info.header.frame_id, "left_surface_optical");
    EXPECT_EQ(info.width, 500U);
    EXPECT_EQ(info.height, 401U);
    EXPECT_STREQ(info.distortion_model, "");
    EXPECT_THAT(info.k, testing::ElementsAre(testing::DoubleNear(25000, 1e-6), 0, 249.5, 0,
                                             testing::DoubleNear(25000, 1e-6), 200, 0, 0, 1));
    EXPECT_THAT(info.r, testing::ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1));
    // (x, y, z) is at pixel (25000 x + 249.5, 25000 y + 200), whatever z is.
    EXPECT_THAT(info.p, testing::ElementsAre(testing::DoubleNear(25000, 1e-6), 0, 0, 249.5, 0,
                                             testing::DoubleNear(25000, 1e-6), 0, 200, 0, 0, 0, 1));
  });
}

TEST_F(DdsMessages, ImagesInMetresAndInMicrometres) {
  const auto& type = sensor_msgs_msg_dds__Image__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  auto& map = *frame.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(3);
  map.set_height(1);
  map.set_um_per_unit(2);
  map.set_untrusted_value(-32768);
  map.set_data(std::string("\x01\0\0\x80\xff\xff", 6));  // 1, untrusted, −1
  write_image(one.writer, header, frame, true);
  check_one<sensor_msgs_msg_dds__Image_>(one, type, [&](const auto& image) {
    EXPECT_EQ(image.width, 3U);
    EXPECT_EQ(image.height, 1U);
    EXPECT_STREQ(image.encoding, "32FC1");
    EXPECT_EQ(image.step, 12U);
    EXPECT_EQ(image.is_bigendian, 0);
    ASSERT_EQ(image.data._length, 12U);
    std::array<float, 3> metres{};
    std::memcpy(metres.data(), image.data._buffer, 12);
    EXPECT_NEAR(metres[0], 2e-6, 1e-12);
    EXPECT_TRUE(std::isnan(metres[1]));
    EXPECT_NEAR(metres[2], -2e-6, 1e-12);
  });
  write_image(one.writer, header, frame, false);
  check_one<sensor_msgs_msg_dds__Image_>(one, type, [&](const auto& image) {
    EXPECT_STREQ(image.encoding, "16UC1");
    EXPECT_EQ(image.step, 6U);
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(image.data._buffer), image.data._length),
              std::string("\x02\0\0\0\0\0", 6));
  });
}

TEST_F(DdsMessages, AContactInMetresAndNewtons) {
  const auto& type = dtact_msgs_msg_dds__Contact__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  frame.set_sequence(41);
  frame.set_dropped(3);
  frame.add_health(v1::HEALTH_STARTING);
  frame.mutable_depth()->set_uncertainty_um(23);
  auto& contact = *frame.mutable_contact();
  contact.set_in_contact(true);
  contact.set_area_mm2(6);
  contact.set_x_mm(1.5);
  contact.set_y_mm(-2.5);
  contact.set_deepest_mm(0.75);
  contact.set_deepest_x_mm(1.25);
  contact.set_deepest_y_mm(-3.5);
  contact.set_volume_mm3(4);
  contact.set_threshold_mm(0.03);
  contact.set_force_n(2);
  contact.set_force_uncertainty_n(0.25);
  write_contact(one.writer, header, frame);
  check_one<dtact_msgs_msg_dds__Contact_>(one, type, [&](const auto& it) {
    EXPECT_EQ(it.header.stamp.nanosec, 7U);
    EXPECT_EQ(it.frame_number, 41U);
    EXPECT_EQ(it.dropped, 3U);
    ASSERT_EQ(it.health._length, 1U);
    EXPECT_STREQ(it.health._buffer[0], "starting");
    EXPECT_TRUE(it.measured);
    EXPECT_STREQ(it.absence, "");
    EXPECT_TRUE(it.in_contact);
    EXPECT_NEAR(it.area, 6e-6, 1e-15);
    EXPECT_NEAR(it.centroid.x, 1.5e-3, 1e-12);
    EXPECT_NEAR(it.centroid.y, -2.5e-3, 1e-12);
    EXPECT_EQ(it.centroid.z, 0);
    EXPECT_NEAR(it.indentation, 0.75e-3, 1e-12);
    EXPECT_NEAR(it.deepest_at.x, 1.25e-3, 1e-12);
    EXPECT_NEAR(it.deepest_at.y, -3.5e-3, 1e-12);
    EXPECT_NEAR(it.volume, 4e-9, 1e-18);
    EXPECT_NEAR(it.threshold, 0.03e-3, 1e-12);
    EXPECT_NEAR(it.uncertainty, 23e-6, 1e-12);
    EXPECT_EQ(it.force, 2);
    EXPECT_EQ(it.force_uncertainty, 0.25);
    EXPECT_STREQ(it.force_absence, "");
  });
  contact.clear_force_n();
  contact.clear_force_uncertainty_n();
  contact.set_force_absence(v1::FORCE_ABSENCE_CUT_OFF);
  frame.clear_depth();
  write_contact(one.writer, header, frame);
  check_one<dtact_msgs_msg_dds__Contact_>(one, type, [&](const auto& it) {
    EXPECT_TRUE(std::isnan(it.force));
    EXPECT_TRUE(std::isnan(it.force_uncertainty));
    EXPECT_TRUE(std::isnan(it.uncertainty));
    EXPECT_STREQ(it.force_absence, "cut_off");
  });
  frame.clear_contact();
  frame.set_contact_absence(v1::CONTACT_ABSENCE_REFERENCING);
  write_contact(one.writer, header, frame);
  check_one<dtact_msgs_msg_dds__Contact_>(one, type, [&](const auto& it) {
    EXPECT_FALSE(it.measured);
    EXPECT_STREQ(it.absence, "referencing");
    EXPECT_STREQ(it.force_absence, "");
  });
}

// On a sphere of 10 mm whose apex is the origin the normal at the side leans outwards.
TEST_F(DdsMessages, AWrenchAboutTheOrigin) {
  const auto& type = geometry_msgs_msg_dds__WrenchStamped__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  write_wrench(one.writer, header, frame);  // nothing: no force is known
  auto& contact = *frame.mutable_contact();
  contact.set_force_n(2);
  contact.set_x_mm(1.5);
  contact.set_y_mm(-2.5);
  write_wrench(one.writer, header, frame);
  check_one<geometry_msgs_msg_dds__WrenchStamped_>(one, type, [&](const auto& it) {
    EXPECT_STREQ(it.header.frame_id, "left_surface_optical");
    EXPECT_NEAR(it.wrench.force.x, 0, 1e-12);
    EXPECT_NEAR(it.wrench.force.y, 0, 1e-12);
    EXPECT_NEAR(it.wrench.force.z, -2, 1e-12);
    // (1.5, −2.5, 0) mm × (0, 0, −2) N.
    EXPECT_NEAR(it.wrench.torque.x, 5e-3, 1e-12);
    EXPECT_NEAR(it.wrench.torque.y, 3e-3, 1e-12);
    EXPECT_NEAR(it.wrench.torque.z, 0, 1e-12);
  });
  auto& surface = *frame.mutable_surface();
  surface.set_shape(v1::Surface::SPHERE);
  surface.set_radius_mm(10);
  surface.set_air_mm(20);
  surface.set_gel_mm(5);
  surface.set_refraction(1.41);
  write_wrench(one.writer, header, frame);
  check_one<geometry_msgs_msg_dds__WrenchStamped_>(one, type, [&](const auto& it) {
    const auto& f = it.wrench.force;
    EXPECT_NEAR(std::hypot(f.x, f.y, f.z), 2, 1e-9);
    EXPECT_LT(f.x, -0.2);
    EXPECT_GT(f.y, 0.4);
    // It goes through the sphere's middle, (0, 0, −10) mm: the torque about that is none, and so
    // that about the origin is (0, 0, −0.01) × f.
    EXPECT_NEAR(it.wrench.torque.x, 0.01 * f.y, 1e-6);
    EXPECT_NEAR(it.wrench.torque.y, -0.01 * f.x, 1e-6);
    EXPECT_NEAR(it.wrench.torque.z, 0, 1e-6);
  });
}

TEST_F(DdsMessages, APose) {
  const auto& type = geometry_msgs_msg_dds__PoseStamped__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  auto& pose = *frame.mutable_pose();
  pose.mutable_translation_mm()->set_x(1.5);
  pose.mutable_translation_mm()->set_y(-2.25);
  pose.mutable_translation_mm()->set_z(0.75);
  // 120° about (1, −2, 2) / 3.
  pose.mutable_rotation_deg()->set_x(40);
  pose.mutable_rotation_deg()->set_y(-80);
  pose.mutable_rotation_deg()->set_z(80);
  write_pose(one.writer, header, frame);
  check_one<geometry_msgs_msg_dds__PoseStamped_>(one, type, [&](const auto& it) {
    EXPECT_EQ(it.header.stamp.sec, 3);
    EXPECT_NEAR(it.pose.position.x, 0.0015, 1e-12);
    EXPECT_NEAR(it.pose.position.y, -0.00225, 1e-12);
    EXPECT_NEAR(it.pose.position.z, 0.00075, 1e-12);
    EXPECT_NEAR(it.pose.orientation.x, 0.28867513, 1e-8);
    EXPECT_NEAR(it.pose.orientation.y, -0.57735027, 1e-8);
    EXPECT_NEAR(it.pose.orientation.z, 0.57735027, 1e-8);
    EXPECT_NEAR(it.pose.orientation.w, 0.5, 1e-8);
  });
}

TEST_F(DdsMessages, TheTrackingOfAnObject) {
  const auto& type = dtact_msgs_msg_dds__ObjectTracking__desc;
  const Topic one = topic(type);
  v1::ObjectPose pose;
  pose.set_valid(true);
  pose.set_tracking(v1::ObjectPose::RECOVERED);
  pose.set_object("nut");
  pose.set_since_sequence(41);
  pose.set_alternatives(5);
  pose.add_unobservable();
  pose.add_unobservable();
  pose.set_residual_um(12);
  write_tracking(one.writer, header, pose);
  check_one<dtact_msgs_msg_dds__ObjectTracking_>(one, type, [&](const auto& it) {
    EXPECT_STREQ(it.header.frame_id, "left_surface_optical");
    EXPECT_TRUE(it.valid);
    EXPECT_STREQ(it.tracking, "recovered");
    EXPECT_STREQ(it.object_name, "nut");
    EXPECT_EQ(it.since_sequence, 41U);
    EXPECT_EQ(it.alternatives, 5U);
    EXPECT_EQ(it.unobservable, 2U);
    EXPECT_NEAR(it.residual, 12e-6, 1e-15);
  });
}

TEST_F(DdsMessages, WhatTheObjectIs) {
  const auto& type = dtact_msgs_msg_dds__Recognition__desc;
  const Topic one = topic(type);
  v1::Recognition recognition;
  recognition.set_verdict(v1::Recognition::CUT_OFF);
  for (const auto& [name, probability] : {std::pair("nut", 0.75), {"ball", 0.125}}) {
    recognition.add_candidates()->set_name(name);
    recognition.mutable_candidates()->rbegin()->set_probability(probability);
  }
  recognition.set_score(0.875);
  recognition.set_presses(3);
  write_recognition(one.writer, header, recognition);
  check_one<dtact_msgs_msg_dds__Recognition_>(one, type, [&](const auto& it) {
    EXPECT_STREQ(it.verdict, "cut_off");
    ASSERT_EQ(it.candidates._length, 2U);
    EXPECT_STREQ(it.candidates._buffer[0], "nut");
    EXPECT_STREQ(it.candidates._buffer[1], "ball");
    ASSERT_EQ(it.probabilities._length, 2U);
    EXPECT_EQ(it.probabilities._buffer[0], 0.75);
    EXPECT_EQ(it.probabilities._buffer[1], 0.125);
    EXPECT_EQ(it.score, 0.875);
    EXPECT_EQ(it.presses, 3U);
  });
}

TEST_F(DdsMessages, AClockMapping) {
  const auto& type = dtact_msgs_msg_dds__ClockMapping__desc;
  const Topic one = topic(type);
  write_clock(one.writer, header, {1, 20, 300, -4000}, v1::TIMESTAMP_START_OF_EXPOSURE);
  check_one<dtact_msgs_msg_dds__ClockMapping_>(one, type, [&](const auto& it) {
    EXPECT_EQ(it.offset_ns, 20);
    EXPECT_EQ(it.error_ns, 300);
    EXPECT_EQ(it.daemon_wall_ahead_ns, -4000);
    EXPECT_STREQ(it.stamp_meaning, "start_of_exposure");
  });
  write_clock(one.writer, header, {}, v1::TIMESTAMP_UNSPECIFIED);
  check_one<dtact_msgs_msg_dds__ClockMapping_>(
      one, type, [&](const auto& it) { EXPECT_STREQ(it.stamp_meaning, ""); });
}

// x of the link points from the gel to the object, which is z of the surface; z of the link is up,
// which is −y of the surface.
TEST_F(DdsMessages, TheSurfacesFrameInTheLinks) {
  const auto& type = tf2_msgs_msg_dds__TFMessage__desc;
  const Topic one = topic(type);
  write_transforms(one.writer, header.stamp_ns, {"left", "right"});
  check_one<tf2_msgs_msg_dds__TFMessage_>(one, type, [&](const auto& it) {
    ASSERT_EQ(it.transforms._length, 2U);
    EXPECT_STREQ(it.transforms._buffer[0].header.frame_id, "left_link");
    EXPECT_STREQ(it.transforms._buffer[1].child_frame_id, "right_surface_optical");
    const auto& q = it.transforms._buffer[1].transform.rotation;
    // The surface's z and y in the link, the last two columns of the rotation.
    EXPECT_NEAR(2 * (q.x * q.z + q.w * q.y), 1, 1e-12);
    EXPECT_NEAR(2 * (q.y * q.z + q.w * q.x), -1, 1e-12);
    EXPECT_NEAR(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w, 1, 1e-12);
  });
}

TEST_F(DdsMessages, PointsInContactOrAll) {
  const auto& type = sensor_msgs_msg_dds__PointCloud2__desc;
  const Topic one = topic(type);
  v1::Frame frame;
  frame.mutable_contact()->set_in_contact(true);
  frame.mutable_contact()->set_threshold_mm(0.2);
  auto& map = *frame.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(3);
  map.set_height(2);
  map.set_full_width(3);
  map.set_full_height(2);
  map.set_mm_per_px(0.5);
  map.set_um_per_unit(100);
  map.set_untrusted_value(-1);
  // 0, 0.1, 0.2 mm above 0.1, 0.2 and 0.3 mm.
  map.set_data(std::string("\0\0\x01\0\x02\0\x01\0\x02\0\x03\0", 12));
  const auto rows_of = [](const sensor_msgs_msg_dds__PointCloud2_& cloud) {
    EXPECT_EQ(cloud.height, 1U);
    EXPECT_EQ(cloud.point_step, 28U);
    EXPECT_EQ(cloud.row_step, 28 * cloud.width);
    EXPECT_EQ(cloud.data._length, 28 * cloud.width);
    std::vector<std::array<float, 7>> rows(cloud.width);
    std::memcpy(rows.data(), cloud.data._buffer, cloud.data._length);
    return rows;
  };
  PointWriter writer;
  writer.write(one.writer, header, frame, false);
  check_one<sensor_msgs_msg_dds__PointCloud2_>(one, type, [&](const auto& cloud) {
    const auto rows = rows_of(cloud);
    ASSERT_EQ(rows.size(), 3U) << "0.2 mm is in contact";
    const auto is = [](const std::array<float, 7>& row, double x_mm, double y_mm, double deep_mm) {
      EXPECT_NEAR(row[0], 1e-3 * x_mm, 1e-9);
      EXPECT_NEAR(row[1], 1e-3 * y_mm, 1e-9);
      EXPECT_NEAR(row[2], -1e-3 * deep_mm, 1e-9);
      EXPECT_NEAR(std::hypot(row[3], row[4], row[5]), 1, 1e-6);
      EXPECT_NEAR(row[6], 1e-3 * deep_mm, 1e-9);
    };
    is(rows[0], 0.5, -0.25, 0.2);
    is(rows[1], 0, 0.25, 0.2);
    is(rows[2], 0.5, 0.25, 0.3);
  });
  writer.write(one.writer, header, frame, true);
  check_one<sensor_msgs_msg_dds__PointCloud2_>(
      one, type, [&](const auto& cloud) { EXPECT_EQ(rows_of(cloud).size(), 6U); });
  frame.mutable_contact()->set_in_contact(false);
  writer.write(one.writer, header, frame, false);
  check_one<sensor_msgs_msg_dds__PointCloud2_>(
      one, type, [&](const auto& cloud) { EXPECT_EQ(rows_of(cloud).size(), 0U); });
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
