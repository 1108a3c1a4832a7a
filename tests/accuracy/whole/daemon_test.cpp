// The whole program in one process sends the same as the daemon.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "proto/dtact.pb.h"
#include "tests/accuracy/whole/program.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::whole {
namespace {

constexpr const char* kScene = R"(
[gel]
solve_step_mm = 0.1
[[press]]
object = "star"
radius_mm = 3.0
keys = [
  { t = 2.5, x = -1.2, y = 0.7, rotation = 20.0, depth = 0.0 },
  { t = 3.0, depth = 0.7 },
  { t = 5.0, x = 0.3, rotation = 35.0 },
]
)";

/// Difference of the common pixels, micrometres: the mean and the greatest difference.
struct Difference {
  double mean_um = 0;
  int worst_um = 0;
  int pixels = 0;
};
Difference difference(const v1::DepthMap& a, const v1::DepthMap& b) {
  const auto value = [](const v1::DepthMap& map, std::uint32_t column, std::uint32_t row) {
    std::int16_t um = 0;
    const std::size_t at = (row - map.y()) * map.width() + column - map.x();
    std::copy_n(map.data().data() + at * sizeof um, sizeof um, reinterpret_cast<char*>(&um));
    return um;
  };
  Difference found;
  double sum = 0;
  for (auto row = std::max(a.y(), b.y()); row < std::min(a.y() + a.height(), b.y() + b.height());
       ++row) {
    for (auto column = std::max(a.x(), b.x());
         column < std::min(a.x() + a.width(), b.x() + b.width()); ++column) {
      const int off = std::abs(value(a, column, row) - value(b, column, row));
      found.worst_um = std::max(found.worst_um, off);
      sum += off;
      ++found.pixels;
    }
  }
  found.mean_um = sum / std::max(1, found.pixels);
  return found;
}

// Both process the same camera frames, noise included. Their references may average other frames.
TEST(Program, SendsTheDaemonsDepth) {
  const e2e::TempFolder folder;
  const std::filesystem::path scene = folder.path() / "scene.toml";
  base::write_file_atomically(scene, kScene);
  const e2e::Sensor sensor(scene);
  client::Client client = sensor.connect();
  v1::Subscribe subscription;
  subscription.set_depth(v1::DEPTH_INT16);
  subscription.set_contact_box(true);
  subscription.set_summary(true);
  client.subscribe(subscription);
  std::map<std::uint64_t, v1::Frame> sent;
  ASSERT_TRUE(e2e::read_until(
      client,
      [&](const e2e::Item& item) {
        const auto* frame = std::get_if<v1::Frame>(&item);
        if (frame != nullptr && frame->has_depth()) sent[frame->sequence()] = *frame;
        return sent.size() == 40;
      },
      std::chrono::seconds(60)));

  Program program(solve(kScene), e2e::calibration_folder());
  v1::Frame frame;
  int compared = 0;
  for (std::uint64_t n = 0; n <= sent.rbegin()->first; ++n) {
    ASSERT_TRUE(frame.ParseFromString(program.next()));
    ASSERT_EQ(frame.sequence(), n);
    const auto daemons = sent.find(n);
    if (daemons == sent.end() || !frame.has_depth()) continue;
    const Difference off = difference(frame.depth(), daemons->second.depth());
    EXPECT_GT(off.pixels, 5000) << n;
    EXPECT_LT(off.mean_um, 2) << n;
    EXPECT_LT(off.worst_um, 15) << n;
    EXPECT_NEAR(frame.depth().uncertainty_um(), daemons->second.depth().uncertainty_um(), 1) << n;
    EXPECT_NEAR(frame.contact().x_mm(), daemons->second.contact().x_mm(), 0.01) << n;
    if (compared++ % 10 == 0) {
      fmt::print("frame {}: {:.2f} um on average, {} um at most, {} pixels\n", n, off.mean_um,
                 off.worst_um, off.pixels);
    }
  }
  EXPECT_GE(compared, 35);
}

}  // namespace
}  // namespace dtact::whole
