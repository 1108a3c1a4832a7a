// Today's daemon and a client of version 1.0; today's client and a daemon of version 1.0. The old
// side is a program of its own, since two versions of the messages cannot live in one.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

#include "clients/cpp/client.hpp"
#include "clients/cpp/maps.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

struct Closer {
  void operator()(std::FILE* pipe) const { ::pclose(pipe); }
};
using Pipe = std::unique_ptr<std::FILE, Closer>;

std::string read_all(std::FILE* from) {
  std::string text;
  for (int c = std::fgetc(from); c != EOF; c = std::fgetc(from)) text += static_cast<char>(c);
  return text;
}

TEST(Frozen, AClientOfVersion10UnderstandsTodaysDaemon) {
  Rig rig({}, answer_done);
  pipeline::Status status;
  status.camera.identity = "usb-1.2";
  status.light_since_ns = 5;
  rig.port.set_status(status);
  std::atomic<bool> stop{false};
  std::thread sensor([&] {
    while (!stop) {
      auto frame = make_frame(5);
      frame.light.brightness = 200;
      frame.light_since_ns = 3;
      frame.calibration = 0;
      frame.health.set(pipeline::Health::starting);
      frame.contact.touching = true;
      frame.contact.deepest_mm = 0.25;
      rig.port.publish(frame);
      rig.port.emit(pipeline::ContactChanged{true, {5, 6, 7}, frame.contact});
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  const Pipe client(::popen((DTACT_CLIENT_1_0 " " + std::to_string(rig.tcp_port())).c_str(), "r"));
  const std::string told = read_all(client.get());
  stop = true;
  sensor.join();
  EXPECT_EQ(told,
            "hello 1: dtactd 9.8.7, dtact_surface\n"
            "subscribed 1\n"
            "frame 5: dtact_surface, health 1, light 200, touching 1, 0.25 mm, encoded 1\n"
            "depth 1: 8x4, 0.050 mm, 1 um, 64 bytes\n"
            "luma 8x4, 32 bytes\n"
            "summary 1\n"
            "frame 5: dtact_surface, health 1, light 200, touching 1, 0.25 mm, encoded 1\n"
            "event 1: touching 1\n"
            "light 100\n"
            "rezero 1\n"
            "status: camera usb-1.2, 1 client, of 1.0\n"
            "calibrations 4\n");
}

TEST(Frozen, TodaysClientUnderstandsADaemonOfVersion10) {
  const Pipe server(::popen(DTACT_SERVER_1_0, "r"));
  int port = 0;
  ASSERT_EQ(std::fscanf(server.get(), "%d", &port), 1);
  client::Options options;
  options.port = static_cast<std::uint16_t>(port);
  client::Client client(options);
  EXPECT_EQ(client.server().minor(), 0U);
  EXPECT_EQ(client.server().features_size(), 0);
  client.subscribe();
  auto item = client.next(kPatience);
  ASSERT_TRUE(item.has_value());
  const auto& frame = std::get<v1::Frame>(*item);
  EXPECT_EQ(frame.sequence(), 7U);
  EXPECT_EQ(frame.contact_absence(), v1::CONTACT_ABSENCE_NONE);
  EXPECT_EQ(client::values_of(frame.depth()), (std::vector<std::int16_t>{5, -32768}));
  item = client.next(kPatience);
  ASSERT_TRUE(item.has_value());
  EXPECT_EQ(std::get<v1::Event>(*item).calibration().name(), "ball");
  EXPECT_EQ(client.status().state(), v1::STATE_SERVING);

  v1::Subscribe later;
  later.set_depth(v1::DEPTH_RVL);
  try {
    client.subscribe(later);
    FAIL() << "no refusal";
  } catch (const client::Refused& refused) {
    EXPECT_STRNE(refused.what(), "");
  }
  EXPECT_EQ(client.status().state(), v1::STATE_SERVING) << "and it goes on";
}

}  // namespace
}  // namespace dtact::net::test
