// dtact-perceive beside a daemon on the simulated sensor: its messages and motion, compared with
// the pressed object.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <thread>

#include "tests/e2e/press.hpp"
#include "tests/e2e/sensor.hpp"
#include "tests/fakes/perceive_server.hpp"

namespace dtact::e2e {
namespace {

TEST(Perceive, FollowsASlidingBallWithoutItsRotation) {
  const TempFolder folder;
  const Press press(folder);
  const Sensor sensor(press.file);
  const fakes::PerceiveServer perceive(sensor.options());
  client::Client client = perceive.connect();
  v1::Subscribe subscription;
  subscription.set_pose(true);
  client.subscribe(subscription);
  std::uint64_t since = 0;
  std::vector<double> slide_um;
  double turned = 0;
  int tracked = 0;
  int others = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr || !frame->has_pose()) return false;
        const v1::ObjectPose& pose = frame->pose();
        if (pose.tracking() == v1::ObjectPose::STARTED) since = frame->sequence();
        if (since == 0 || pose.since_sequence() != since) return false;
        // The slide, from the held position on.
        const double t = press.time_s(frame->sequence());
        if (t < 4.2 || t > 11.9) return false;
        ++(pose.tracking() == v1::ObjectPose::TRACKED ? tracked : others);
        const auto now = press.middle(frame->sequence());
        const auto then = press.middle(since);
        const double error = std::hypot(pose.translation_mm().x() - (now[0] - then[0]),
                                        pose.translation_mm().y() - (now[1] - then[1]));
        EXPECT_FALSE(frame->has_depth());
        if (t > 10.2) {
          slide_um.push_back(1000 * error);
          turned = std::max(turned, std::hypot(pose.rotation_deg().x(), pose.rotation_deg().y(),
                                               pose.rotation_deg().z()));
          EXPECT_EQ(pose.unobservable_size(), 3);
        }
        return t > 11.5 && slide_um.size() > 10;
      },
      std::chrono::seconds(60)));
  const double worst_um = *std::max_element(slide_um.begin(), slide_um.end());
  std::printf(
      "a ball slid by 1 mm: at most %.0f um off, turned by %.2f degrees; %d frames tracked, %d "
      "not\n",
      worst_um, turned, tracked, others);
  EXPECT_LT(worst_um, 200);
  EXPECT_LT(turned, 0.5);
  EXPECT_LT(others, tracked / 20 + 1);
}

TEST(Perceive, RefusesWhatTheDaemonServesAndIsRefusedItsOwnThere) {
  const Sensor sensor;
  const fakes::PerceiveServer perceive(sensor.options());
  client::Client client = perceive.connect();
  EXPECT_TRUE(client.has_feature("cloud"));
  EXPECT_THROW(client.subscribe(), client::Refused);
  EXPECT_THROW((void)client.calibration(), client::Refused);
  EXPECT_GT(client.ping().monotonic_ns(), 0);
  EXPECT_EQ(client.status().clients_size(), 1);
  v1::Subscribe points;
  points.set_cloud(v1::CLOUD_INT16);
  client::Client daemon = sensor.connect();
  EXPECT_THROW(daemon.subscribe(points), client::Refused);
}

TEST(Perceive, AsksTheDaemonForNothingThatNobodyWants) {
  const Sensor sensor;
  const fakes::PerceiveServer perceive(sensor.options());
  client::Client client = perceive.connect();
  client::Client daemon = sensor.connect();
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const auto sent = [&] {
    std::uint64_t all = 0;
    const v1::Status status = daemon.status();
    for (const auto& one : status.clients()) all += one.sent();
    return all;
  };
  EXPECT_EQ(sent(), 0U);
  v1::Subscribe summary;
  summary.set_summary(true);
  client.subscribe(summary);
  ASSERT_TRUE(
      read_until(client, [](const Item& item) { return std::holds_alternative<v1::Frame>(item); }));
  EXPECT_GT(sent(), 0U);
}

}  // namespace
}  // namespace dtact::e2e
