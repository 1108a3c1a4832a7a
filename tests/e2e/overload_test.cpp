// Clients and cameras that ask more than there is: an honest client is still served. Counts are
// asserted; times are printed, since a test machine has delays of its own.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <list>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/e2e/besieged.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/unit/net/raw_client.hpp"

namespace dtact::e2e {
namespace {

using net::test::connected;
using net::test::connected_from;
using net::test::RawClient;

v1::ClientMessage get_status() {
  v1::ClientMessage message;
  message.mutable_get_status();
  return message;
}

// Before: all 32 places were taken, and root was refused.
TEST(Overload, OneProcessOnEveryLoopbackAddress) {
  const TempFolder run;
  const std::filesystem::path path = run.path() / "dtactd.sock";
  Besieged daemon({"net.unix_socket=" + path.string()});
  daemon.begin();
  std::list<RawClient> greedy;
  int served = 0;
  for (int i = 0; i < 30; ++i) {
    const std::string from = fmt::format("127.0.0.{}", 2 + i % 3);
    greedy.emplace_back(connected_from(from.c_str(), daemon.port()));
    served += greedy.back().say_hello().has_hello() ? 1 : 0;
  }
  // Two of this machine's 16 places are the honest clients'.
  EXPECT_EQ(served, 14);
  RawClient root(connected(path));
  root.hello();
  EXPECT_TRUE(root.request(get_status()).has_status());
  fmt::print("of 30 connections from three loopback addresses {} were served\n", served);
  root.die();
  greedy.clear();
  daemon.end("30 clients from three loopback addresses");
}

// Before: 32 and more of their requests went first, and it took 7 to 11 s.
TEST(Overload, ReadersOfTheReferenceDelayNoActivation) {
  Besieged daemon;
  daemon.begin();
  std::atomic<bool> stop{false};
  std::atomic<int> answered{0};
  std::vector<std::thread> readers;
  for (int i = 0; i < 10; ++i) {
    readers.emplace_back([&] {
      RawClient reader(daemon.port());
      reader.hello();
      v1::ClientMessage message;
      message.mutable_get_reference();
      while (!stop) {
        if (reader.request(message).has_reference()) ++answered;
        // A refusal comes at once: this stays below what a connection is ended for.
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
    });
  }
  while (answered < 20) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  RawClient control(daemon.port());
  control.hello();
  v1::ClientMessage message;
  message.mutable_activate_calibration()->set_number(0);
  const int before = answered;
  const auto began = std::chrono::steady_clock::now();
  EXPECT_TRUE(control.request(message).has_done());
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  const int during = answered - before;
  EXPECT_LE(during, 16);
  fmt::print("an activation beside ten clients that read the reference: {:.2f} s, {} of theirs\n",
             took.count(), during);
  stop = true;
  for (std::thread& reader : readers) reader.join();
  control.die();
  daemon.end("ten clients that read the reference");
}

/// A real-time limit for what this program starts; its own is set back at the end.
class RttimeLimit {
 public:
  RttimeLimit(rlim_t soft_us, rlim_t hard_us) {
    ::getrlimit(RLIMIT_RTTIME, &before_);
    const rlimit limit{.rlim_cur = soft_us, .rlim_max = hard_us};
    ::setrlimit(RLIMIT_RTTIME, &limit);
  }
  ~RttimeLimit() { ::setrlimit(RLIMIT_RTTIME, &before_); }
  RttimeLimit(const RttimeLimit&) = delete;
  RttimeLimit& operator=(const RttimeLimit&) = delete;

 private:
  rlimit before_{};
};

// Before: the kernel ended the daemon once the capture thread had run for the unit's LimitRTTIME=.
TEST(Overload, ACameraModeTooHeavyForTheMachine) {
  const TempFolder folder;
  const auto jpeg = fakes::make_jpeg({.width = 3200, .height = 2400}, [](int x, int y) {
    return (x * 7 + y * 13 + x * y / 64) % 256;  // detail takes time to decode
  });
  for (const char* name : {"00000.jpg", "00001.jpg"}) {
    std::ofstream(folder.path() / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(jpeg.data()), std::ssize(jpeg));
  }
  std::unique_ptr<Sensor> sensor;
  {
    const RttimeLimit limit(300'000, 500'000);  // as in the unit
    sensor = std::make_unique<Sensor>(
        std::filesystem::path(), false,
        std::vector<std::string>{"camera.backend=replay",
                                 "camera.replay.folder=" + folder.path().string(),
                                 "camera.replay.loop=true", "camera.fps=1000"});
  }
  client::Client client = sensor->connect("honest");
  v1::Subscribe subscribe;
  subscribe.set_summary(true);
  client.subscribe(subscribe);
  int frames = 0;
  int named = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr) return false;
        ++frames;
        named += has(frame->health(), v1::HEALTH_MACHINE_SLOW) ? 1 : 0;
        return named == 30;
      },
      std::chrono::seconds(60)))
      << sensor->daemon->log();
  const v1::Status status = client.status();
  EXPECT_NE(status.advice().find("lower camera.fps"), std::string::npos) << status.advice();
  EXPECT_GT(status.camera().skipped(), 0U);
  fmt::print("3200x2400 at 1000 a second: {} frames, {} skipped; {}\n", frames,
             status.camera().skipped(),
             status.realtime_refused().empty() ? "real-time" : "no real-time scheduling here");
  EXPECT_EQ(sensor->daemon->stop(SIGTERM), 0);
}

// The kernel sends SIGXCPU to a real-time thread that has run for too long.
TEST(Overload, ANetworkThreadThatLosesItsPriority) {
  const Sensor sensor;
  client::Client client = sensor.connect();
  ::kill(sensor.daemon->pid(), SIGXCPU);
  const std::string sentence = "thread network had more work than time";
  const auto reported = [&] {
    const auto status = client.status();
    return std::ranges::any_of(status.realtime_refused(), [&](const std::string& refused) {
      return refused.find(sentence) != std::string::npos;
    });
  };
  while (!reported() || sensor.daemon->log().find(sentence) == std::string::npos) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // ctest's time-out ends it
  }
}

}  // namespace
}  // namespace dtact::e2e
