// The reference image: at start, on command, and under a changed light.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>

#include "hal/base/atomic_file.hpp"
#include "hal/sim/scene.hpp"
#include "tests/e2e/depth_error.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

/// A ball of 5 mm pressed 1 mm deep for two seconds of every five, from second 2.5 on.
constexpr const char* kPresses = R"(
[loop]
from_s = 2.0
to_s = 7.0
[[press]]
object = "ball"
radius_mm = 5.0
keys = [ { t = 2.5, x = 1.0, y = 1.0, depth = 0.0 }, { t = 3.0, depth = 1.0 }, { t = 5.0 }, { t = 5.5, depth = 0.0 } ]
)";

std::filesystem::path write_scene(const TempFolder& folder) {
  const std::filesystem::path file = folder.path() / "presses.toml";
  base::write_file_atomically(file, kPresses);
  return file;
}

/// Waits for a frame with depth that has contact, or has none.
bool wait_contact(client::Client& client, bool in_contact) {
  return read_until(client, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && frame->has_depth() && frame->contact().in_contact() == in_contact;
  });
}

bool wait_reference(client::Client& client) {
  return read_until(client, [](const Item& item) {
    const auto* event = std::get_if<v1::Event>(&item);
    return event != nullptr && event->has_reference();
  });
}

/// Depth inside the true contact of the next fully pressed frame, and the true depth, millimetres.
struct Pressed {
  double depth_mm = 0;
  double truth_mm = 0;
};
Pressed next_press(client::Client& client, const hal::sim::Truth& truth) {
  Pressed pressed;
  const bool found = read_until(client, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    if (frame == nullptr || !frame->has_depth()) return false;
    const double t = truth.scene().time_s(frame->sequence());
    if (t < 3.5 || t > 4.9) return false;
    const std::vector<float> mm = client::millimetres_of(frame->depth());
    std::vector<float> indentation;
    std::vector<std::uint8_t> contact;
    truth.indentation_mm(frame->sequence(), indentation);
    truth.contact(frame->sequence(), contact);
    int n = 0;
    for (std::size_t y = 0; y < kCropHeight; ++y) {
      for (std::size_t x = 0; x < kCropWidth; ++x) {
        const std::size_t at = (y + kCropRow) * 800 + x + kCropColumn;
        const float depth = mm[y * kCropWidth + x];
        if (contact[at] == 0 || std::isnan(depth)) continue;
        pressed.depth_mm += static_cast<double>(depth);
        pressed.truth_mm += static_cast<double>(indentation[at]);
        ++n;
      }
    }
    pressed.depth_mm /= n;
    pressed.truth_mm /= n;
    return true;
  });
  EXPECT_TRUE(found);
  return pressed;
}

/// `halve` halves the picture's brightness.
void expect_the_same_depth(const std::function<void(client::Client&)>& halve) {
  const TempFolder folder;
  const Sensor sensor(write_scene(folder));
  const hal::sim::Truth truth(hal::sim::load_scene(folder.path() / "presses.toml"));
  client::Client client = sensor.connect();
  client.subscribe();

  const Pressed bright = next_press(client, truth);
  ASSERT_TRUE(wait_contact(client, false));
  halve(client);

  bool unsettled = false;
  ASSERT_TRUE(read_until(client, [&](const Item& item) {
    if (const auto* frame = std::get_if<v1::Frame>(&item)) {
      if (has(frame->health(), v1::HEALTH_LIGHT_UNSETTLED)) {
        unsettled = true;
        EXPECT_FALSE(frame->has_depth()) << "depth while the light changes";
      }
      return false;
    }
    return std::get<v1::Event>(item).has_reference();
  }));
  EXPECT_TRUE(unsettled);
  ASSERT_TRUE(wait_contact(client, false));
  const Pressed dim = next_press(client, truth);
  std::printf(
      "mean depth inside the contact: %.4f mm at full, %.4f mm at half brightness, true "
      "%.4f mm (simulated sensor)\n",
      bright.depth_mm, dim.depth_mm, bright.truth_mm);
  EXPECT_NEAR(dim.depth_mm, bright.depth_mm, 0.03);
  EXPECT_NEAR(bright.depth_mm, bright.truth_mm, 0.05);
}

TEST(Reference, HalvedLightKeepsTheMillimetres) {
  expect_the_same_depth([](client::Client& client) {
    v1::SetLight half;
    half.set_brightness(128);
    EXPECT_EQ(client.set_light(half).brightness(), 128U);
  });
}

TEST(Reference, HalvedExposureKeepsTheMillimetres) {
  expect_the_same_depth([](client::Client& client) {
    v1::SetCamera half;
    half.set_exposure_us(5000);
    const v1::CameraSettings now = client.set_camera(half);
    EXPECT_EQ(now.exposure_us().value(), 5000);
    EXPECT_EQ(now.gain().value(), 1);
  });
}

/// The calibration as a guided session makes it, which knows the camera's exposure.
std::filesystem::path with_exposure(const TempFolder& folder) {
  std::filesystem::path copy = folder.path() / "calibration";
  std::filesystem::copy(calibration_folder(), copy);
  std::ifstream file(copy / "calibration.toml");
  std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::string table = "[camera.controls]\n";
  text.insert(text.find(table) + table.size(), "exposure_permille = 1000\n");
  base::write_file_atomically(copy / "calibration.toml", text);
  return copy;
}

TEST(Reference, AnotherExposureThanTheCalibrationsIsNamedUntilItIsSetBack) {
  const TempFolder folder;
  const Sensor sensor(scene_file("nothing.toml"), false,
                      {"calibration=" + with_exposure(folder).string()});
  client::Client client = sensor.connect();
  client.subscribe();
  ASSERT_TRUE(wait_contact(client, false));
  EXPECT_FALSE(has(client.status().health(), v1::HEALTH_CAMERA_MISMATCH));
  for (const double exposure_us : {4170.0, 10000.0}) {
    v1::SetCamera change;
    change.set_exposure_us(exposure_us);
    EXPECT_NEAR(client.set_camera(change).exposure_us().value(), exposure_us, 0.01);
    EXPECT_TRUE(wait_reference(client));
    EXPECT_TRUE(read_until(client, [&](const Item& item) {
      const auto* frame = std::get_if<v1::Frame>(&item);
      return frame != nullptr && frame->has_depth() &&
             has(frame->health(), v1::HEALTH_CAMERA_MISMATCH) == (exposure_us != 10000.0);
    }));
  }
  v1::SetCamera beyond;
  beyond.set_gain(3);
  try {
    (void)client.set_camera(beyond);
    ADD_FAILURE() << "a gain beyond the camera's";
  } catch (const client::Refused& e) {
    EXPECT_EQ(e.code(), v1::ERROR_INVALID);
    EXPECT_NE(std::string(e.what()).find("set_camera.gain: 3; this camera has 1 to 2"),
              std::string::npos)
        << e.what();
  }
}

TEST(Reference, RezeroIsRefusedUnderContactUnlessForced) {
  const TempFolder folder;
  const Sensor sensor(write_scene(folder));
  client::Client client = sensor.connect();
  client.subscribe();
  ASSERT_TRUE(wait_contact(client, true));
  try {
    client.rezero();
    ADD_FAILURE() << "re-zeroed under contact";
  } catch (const client::Refused& e) {
    EXPECT_EQ(e.code(), v1::ERROR_CONTACT);
    EXPECT_NE(std::string(e.what()).find("force"), std::string::npos) << e.what();
  }
  ASSERT_TRUE(wait_contact(client, false));
  ASSERT_TRUE(wait_contact(client, true));
  client.rezero(true);
  EXPECT_TRUE(wait_contact(client, false)) << "the pressed image is zero now";
}

TEST(Reference, RezeroWithoutContactTakesANewReference) {
  const Sensor sensor(scene_file("nothing.toml"));
  client::Client client = sensor.connect();
  client.subscribe();
  ASSERT_TRUE(wait_contact(client, false));
  client.rezero();
  EXPECT_TRUE(wait_reference(client));
}

TEST(Reference, InContactAtStartServesWithTheLastGoodOneAndSaysSo) {
  Sensor sensor(scene_file("nothing.toml"));
  {
    client::Client client = sensor.connect();
    client.subscribe();
    ASSERT_TRUE(wait_contact(client, false));  // its reference is in the state folder after the end
  }
  sensor.arguments.insert(
      sensor.arguments.end(),
      {"--set", "camera.sim.scene=" + scene_file("contact_at_start.toml").string()});
  sensor.restart();

  client::Client client = sensor.connect();
  client.subscribe();
  ASSERT_TRUE(read_until(client, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && frame->has_depth() && frame->contact().in_contact();
  }));
  EXPECT_TRUE(has(client.status().health(), v1::HEALTH_REFERENCE_RESTORED));
  // The press is read in millimetres all the same: 1 mm deep.
  ASSERT_TRUE(read_until(client, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    if (frame == nullptr || !frame->has_depth() || !frame->contact().in_contact()) return false;
    EXPECT_NEAR(frame->contact().deepest_mm(), 1.0, 0.1);
    return true;
  }));
  // The ball leaves after five seconds and a fresh reference is taken.
  EXPECT_TRUE(read_until(client, [](const Item& item) {
    const auto* event = std::get_if<v1::Event>(&item);
    return event != nullptr && event->has_reference() && !event->reference().restored();
  }));
  // The event may come before the first frame that is measured against it.
  EXPECT_TRUE(read_until(client, [](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && !has(frame->health(), v1::HEALTH_REFERENCE_RESTORED);
  }));
}

TEST(Reference, InContactAtTheVeryFirstStartIsNotTakenForAReference) {
  const Sensor sensor(scene_file("contact_at_start.toml"));
  client::Client client = sensor.connect();
  client.subscribe();
  EXPECT_TRUE(read_until(client, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && frame->has_depth() && frame->contact().in_contact() &&
           has(frame->health(), v1::HEALTH_REFERENCE_STALE);
  }));
}

}  // namespace
}  // namespace dtact::e2e
