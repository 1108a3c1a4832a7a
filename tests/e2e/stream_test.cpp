// Depth of the simulated sensor as a client receives it, against the simulator's truth.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdio>

#include "hal/null/null.hpp"
#include "hal/sim/scene.hpp"
#include "tests/e2e/depth_error.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

TEST(Stream, SixHundredFramesOfTheRightDepth) {
  const Sensor sensor;
  client::Client client = sensor.connect();
  client.subscribe();
  const hal::sim::Truth truth(hal::sim::default_scene());

  int frames = 0;
  int judged = 0;
  int pressed = 0;
  std::uint64_t last = 0;
  std::vector<double> inside;
  double worst_no_contact = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr || !frame->has_depth()) return false;
        EXPECT_GT(frame->sequence(), last);
        last = frame->sequence();
        EXPECT_GE(frame->ready_ns(), frame->monotonic_ns());
        EXPECT_GE(frame->published_ns(), frame->ready_ns());
        // Every tenth is judged: the truth of a whole frame takes longer than a frame.
        if (frames++ % 10 == 0) {
          ++judged;
          const DepthError error = depth_error(*frame, truth);
          const bool ball = frame->sequence() % 720 < 360;  // the loop's first press
          if (error.inside_pixels > 5000 && ball) {
            ++pressed;
            inside.push_back(error.inside_mm);
            EXPECT_LT(error.untrusted, error.inside_pixels / 100);
          } else if (error.inside_pixels == 0) {
            worst_no_contact = std::max(worst_no_contact, error.outside_mm);
          }
        }
        return frames == 600;
      },
      std::chrono::seconds(120)));
  EXPECT_EQ(judged, 60);
  ASSERT_GE(pressed, 5);
  const double worst = *std::max_element(inside.begin(), inside.end());
  std::sort(inside.begin(), inside.end());
  RecordProperty("median_error_inside_ball_um", static_cast<int>(1000 * inside[inside.size() / 2]));
  std::printf(
      "ball of 5 mm, simulated sensor: mean absolute error inside the true contact "
      "%.4f mm (median of %d frames), worst frame %.4f mm; no contact %.4f mm\n",
      inside[inside.size() / 2], pressed, worst, worst_no_contact);
  EXPECT_LE(worst, 0.03);
  EXPECT_LE(worst_no_contact, 0.01);
}

// As SixHundredFramesOfTheRightDepth, from pictures of half the size.
TEST(Stream, FramesDecodedAtHalfTheSizeGiveTheRightDepth) {
  const Sensor sensor({}, true, {"camera.decode_scale=2"});
  client::Client client = sensor.connect();
  v1::Subscribe subscription;
  subscription.set_depth(v1::DEPTH_INT16);
  subscription.set_jpeg(true);
  client.subscribe(subscription);
  const hal::sim::Truth truth(hal::sim::default_scene());
  int pressed = 0;
  int jpegs = 0;
  double worst = 0;
  double worst_no_contact = 0;
  ASSERT_TRUE(read_until(
      client,
      [&](const Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame == nullptr) return false;
        if (frame->has_jpeg()) {
          EXPECT_EQ(frame->jpeg().width(), 800U);
          EXPECT_EQ(frame->jpeg().height(), 600U);
          ++jpegs;
        }
        if (!frame->has_depth() || frame->sequence() % 10 != 0) return false;
        EXPECT_EQ(frame->depth().decimation(), 2U);
        EXPECT_EQ(frame->depth().width(), kCropWidth / 2);
        EXPECT_EQ(frame->depth().height(), kCropHeight / 2);
        const DepthError error = depth_error(*frame, truth);
        if (error.inside_pixels == 0) {
          worst_no_contact = std::max(worst_no_contact, error.outside_mm);
        } else if (error.inside_pixels > 1250 && frame->sequence() % 720 < 360) {
          worst = std::max(worst, error.inside_mm);
          ++pressed;
        }
        return pressed == 10;
      },
      std::chrono::seconds(120)));
  EXPECT_GT(jpegs, 0);
  std::printf("decoded at half: worst frame of the ball %.4f mm; no contact %.4f mm\n", worst,
              worst_no_contact);
  EXPECT_LE(worst, 0.03);
  EXPECT_LE(worst_no_contact, 0.01);
}

TEST(Stream, NullCameraReachesAClientAsConstantGrey) {
  const Sensor sensor({}, false, {"camera.backend=null", "ring.backend=null"});
  client::Client client = sensor.connect();
  v1::Subscribe luma;
  luma.set_luma(v1::LUMA_GREY8);
  client.subscribe(luma);
  int frames = 0;
  EXPECT_TRUE(read_until(client, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    if (frame == nullptr || !frame->has_luma()) return false;
    EXPECT_EQ(client::pixels_of(frame->luma()),
              std::vector<std::uint8_t>(480000, hal::null::NullCamera::kGrey));
    return ++frames == 10;
  }));
}

TEST(Stream, CompressedDepthIsTheSameDepth) {
  const Sensor sensor;
  client::Client plain = sensor.connect();
  client::Client packed = sensor.connect();
  plain.subscribe();
  v1::Subscribe subscription;
  subscription.set_depth(v1::DEPTH_PREDICT_ZSTD);
  packed.subscribe(subscription);
  std::vector<v1::Frame> frames;
  ASSERT_TRUE(read_until(plain, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    if (frame != nullptr && frame->has_depth()) frames.push_back(*frame);
    return frames.size() == 10;
  }));
  bool met = false;
  EXPECT_TRUE(read_until(packed, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    if (frame == nullptr || !frame->has_depth()) return false;
    for (const v1::Frame& other : frames) {
      if (other.sequence() != frame->sequence()) continue;
      met = true;
      EXPECT_EQ(client::values_of(other.depth()), client::values_of(frame->depth()));
    }
    return met || frame->sequence() > frames.back().sequence();
  }));
  EXPECT_TRUE(met);
}

TEST(Stream, SendsWhatASubscriptionOfVersion11AsksFor) {
  const Sensor sensor;
  client::Client client = sensor.connect();
  v1::Subscribe subscription;
  subscription.set_depth(v1::DEPTH_PREDICT_ZSTD);
  subscription.set_depth_hz(30);
  subscription.set_decimation(2);
  subscription.set_um_per_unit(5);
  subscription.mutable_box()->set_x(100);
  subscription.mutable_box()->set_y(60);
  subscription.mutable_box()->set_width(200);
  subscription.mutable_box()->set_height(300);
  subscription.set_summary(true);
  client.subscribe(subscription);
  int frames = 0;
  std::vector<std::int64_t> depth_ns;
  ASSERT_TRUE(read_until(client, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    if (frame == nullptr || !frame->has_contact()) return false;
    EXPECT_EQ(frame->contact_absence(), v1::CONTACT_ABSENCE_NONE);
    EXPECT_TRUE(frame->has_calibration());
    EXPECT_EQ(frame->calibration(), 0U) << "the one of the configuration";
    EXPECT_LE(frame->light().since_ns(), frame->monotonic_ns());
    if (frame->has_depth()) {
      const v1::DepthMap& depth = frame->depth();
      EXPECT_EQ(depth.decimation(), 2U);
      EXPECT_EQ(depth.um_per_unit(), 5.0);
      EXPECT_EQ(depth.x(), 50U);
      EXPECT_EQ(depth.y(), 30U);
      EXPECT_EQ(depth.full_width(), kCropWidth / 2);
      EXPECT_EQ(depth.full_height(), kCropHeight / 2);
      EXPECT_EQ(client::values_of(depth).size(), 100U * 150U);
      depth_ns.push_back(frame->monotonic_ns());
    }
    return ++frames == 240;
  }));
  // 30 a second, plus the first, under any load.
  const double seconds = static_cast<double>(depth_ns.back() - depth_ns.front()) / 1e9;
  EXPECT_LE(static_cast<double>(depth_ns.size()), 30 * seconds + 2);
  EXPECT_GT(depth_ns.size(), 60U);
}

TEST(Stream, EndsCleanlyOnSigtermWhileStreaming) {
  const Sensor sensor;
  client::Client client = sensor.connect();
  client.subscribe();
  int frames = 0;
  ASSERT_TRUE(read_until(client, [&](const Item& item) {
    return std::holds_alternative<v1::Frame>(item) && ++frames == 30;
  }));
  EXPECT_EQ(sensor.daemon->stop(SIGTERM), 0) << "not a clean end";
  EXPECT_THROW((void)read_until(client, [](const Item&) { return false; }),
               client::ConnectionError);
}

}  // namespace
}  // namespace dtact::e2e
