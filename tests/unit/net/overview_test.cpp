// The daemon's counts over all clients.
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>
#include <utility>

#include "tests/fakes/own_path.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

TEST(Overview, HasTheHottestOfTheBoardsTemperatures) {
  NetConfig config;
  config.thermal_folder = fakes::own_path();
  for (const auto& [zone, temp] : {std::pair{"thermal_zone0", 48312}, {"thermal_zone1", 51700}}) {
    std::filesystem::create_directories(config.thermal_folder / zone);
    std::ofstream(config.thermal_folder / zone / "temp") << temp << '\n';
  }
  Rig rig(config);
  Overview now = rig.overview();
  for (int i = 0; i < 2000 && now.temperatures.empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    now = rig.overview();
  }
  EXPECT_EQ(now.temperatures.size(), 2U);
  EXPECT_DOUBLE_EQ(now.status.board_celsius(), 51.7);
  std::filesystem::remove_all(config.thermal_folder);
}

TEST(Overview, CountsClientsThatLeftToo) {
  NetConfig config;
  config.max_clients = 1;
  Rig rig(config);
  {
    RawClient client(rig.tcp_port());
    client.hello();
    client.subscribe(v1::DEPTH_INT16);
    rig.port.publish(make_frame(1));
    EXPECT_EQ(client.frame().sequence(), 1U);
    v1::ClientMessage status;
    status.mutable_get_status();
    (void)client.request(status);  // after it the frame is counted
    RawClient too_many(rig.tcp_port());
    EXPECT_EQ(too_many.say_hello().error().code(), v1::ERROR_BUSY);
    const Overview now = rig.overview();
    EXPECT_EQ(now.status.clients_size(), 1);
    EXPECT_EQ(now.traffic.connections, 2U);
    EXPECT_EQ(now.traffic.frames, 1U);
    EXPECT_GT(now.traffic.bytes, 0U);
  }
  ASSERT_TRUE(rig.wait_log("disconnected"));
  // A connection counts as gone a moment after it ended.
  Overview later = rig.overview();
  for (int i = 0; i < 2000 && (later.traffic.refused == 0 || later.traffic.frames == 0); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    later = rig.overview();
  }
  EXPECT_EQ(later.traffic.refused, 1U);
  EXPECT_EQ(later.status.clients_size(), 0);
  EXPECT_EQ(later.traffic.frames, 1U);
  EXPECT_EQ(later.traffic.connections, 2U);
}

TEST(Overview, CountsStagesOfTheNetworkToo) {
  Rig rig;
  pipeline::Status status;
  status.stages = {{"total", 3, 9, 20}};
  rig.port.set_status(status);
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  rig.port.publish(make_frame(1));
  (void)client.frame();
  const Overview overview = rig.overview();
  ASSERT_EQ(overview.stages.size(), 3U);
  EXPECT_EQ(overview.stages[0].stage, "total");
  EXPECT_EQ(overview.stages[2].stage, "encode");
  EXPECT_EQ(overview.stages[2].count, 1U);
}

TEST(Overview, KnowsWhenTheReferenceWasTaken) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_FALSE(rig.overview().reference_taken_ns.has_value());
  rig.port.emit(pipeline::ReferenceTaken{.restored = false});
  (void)client.event();
  EXPECT_TRUE(rig.overview().reference_taken_ns.has_value());
  rig.port.emit(
      pipeline::ReferenceTaken{.restored = true});  // of an earlier run: its age is unknown
  (void)client.event();
  EXPECT_FALSE(rig.overview().reference_taken_ns.has_value());
}

}  // namespace
}  // namespace dtact::net::test
