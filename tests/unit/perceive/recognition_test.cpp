// The recognition: its input, the joining of evidence, the network's outputs, its thread.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "clients/perceive/recognition/recogniser.hpp"
#include "clients/perceive/recognition/recognition_thread.hpp"
#include "clients/perceive/recognition/taught_objects.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {
namespace {

constexpr int kWidth = 125;  // 500 x 400 at a quarter of 0.0417 mm
constexpr int kHeight = 100;
constexpr double kMmPerPx = 4 * 0.0417;

/// Of the ball below: probability of a ball, of another shape, the first features.
constexpr std::array<double, 6> kGolden = {0.768978, 0.230394, 0.034601,
                                           0.081747, 0.149491, 0.022898};

/// A ball of 5 mm, pressed in at (x, y) pixels from the upper left corner.
struct Ball {
  double x = 70;
  double y = 45;
  double deep_mm = 1;
};

std::vector<std::int16_t> values_of(const Ball& ball) {
  std::vector<std::int16_t> values;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double r = kMmPerPx * std::hypot(x - ball.x, y - ball.y);
      const double mm = r < 5 ? ball.deep_mm - 5 + std::sqrt(25 - r * r) : -5;
      values.push_back(static_cast<std::int16_t>(std::lround(1000 * std::max(mm, 0.0))));
    }
  }
  return values;
}

DepthGrid grid_of(const std::vector<std::int16_t>& values) {
  DepthGrid grid;
  grid.width = grid.full_width = kWidth;
  grid.height = grid.full_height = kHeight;
  grid.mm_per_px = kMmPerPx;
  grid.values = values;
  return grid;
}

float at(const TouchMap& map, int row, int column) {
  return map.mm.at(static_cast<std::size_t>(row * TouchMap::kSide + column));
}

TEST(TouchMap, TheContactIsInTheMiddleInCellsOfAQuarterMillimetre) {
  const auto values = values_of({});
  const TouchMap map = touch_map(grid_of(values));
  EXPECT_NEAR(map.deepest_mm, 1, 1e-3);
  EXPECT_EQ(map.cut, 0);
  EXPECT_NEAR(map.area_mm2, 3.14159 * (25 - 4.1 * 4.1), 0.4);
  for (int cell = 0; cell < 9; ++cell) {
    const double mm = TouchMap::kCellMm * (cell + 0.5);
    const double depth = std::max(0.0, 1 - 5 + std::sqrt(25 - mm * mm));
    EXPECT_NEAR(at(map, 48, 48 + cell), depth, 0.03) << cell;
    EXPECT_NEAR(at(map, 47 - cell, 47), depth, 0.03) << cell;
  }
}

TEST(TouchMap, UntrustedPixelsAndThoseBeyondTheMapAreZero) {
  auto values = values_of({.x = 118});
  for (int y = 43; y < 48; ++y) {
    for (int x = 116; x < 121; ++x) values[static_cast<std::size_t>(y * kWidth + x)] = -32768;
  }
  const TouchMap map = touch_map(grid_of(values));
  EXPECT_GT(map.cut, 0.3);
  EXPECT_LT(map.deepest_mm, 1);
  EXPECT_EQ(at(map, 48, 80), 0) << "beyond the depth map";
  EXPECT_LT(*std::ranges::min_element(map.mm), 1e-6);
}

TEST(TouchMap, DepthsAreLimited) {
  const TouchMap map = touch_map(grid_of(values_of({.deep_mm = 4.5})));
  EXPECT_EQ(*std::ranges::max_element(map.mm), TouchMap::kMaxMm);
}

TEST(TouchMap, NoContactIsAllZero) {
  const TouchMap map = touch_map(grid_of(std::vector<std::int16_t>(kWidth * kHeight, 50)));
  EXPECT_EQ(map.deepest_mm, 0);
  EXPECT_EQ(*std::ranges::max_element(map.mm), 0);
}

Network::Output mostly(std::size_t index, double probability) {
  Network::Output output;
  output.probabilities.fill((1 - probability) / static_cast<double>(kClasses));
  output.probabilities.at(index) = probability;
  return output;
}

TouchMap map_of(double deepest_mm, double cut = 0) {
  TouchMap map;
  map.deepest_mm = deepest_mm;
  map.cut = cut;
  return map;
}

TEST(Evidence, HasAVerdictForEachCase) {
  const auto verdict = [](const TouchMap& map, const Network::Output& output) {
    Evidence evidence;
    evidence.add(map, output);
    return evidence.result(1).verdict;
  };
  EXPECT_EQ(verdict(map_of(1), mostly(2, 0.9)), Verdict::known);
  EXPECT_EQ(verdict(map_of(1), mostly(kClasses, 0.9)), Verdict::unknown);
  EXPECT_EQ(verdict(map_of(1), mostly(2, 0.3)), Verdict::unsure);
  EXPECT_EQ(verdict(map_of(0.15), mostly(2, 0.9)), Verdict::too_shallow);
  EXPECT_EQ(verdict(map_of(1, 1.4), mostly(kClasses, 0.9)), Verdict::cut_off);
}

TEST(Evidence, AShallowTouchIsNotTheObjectBefore) {
  Evidence evidence;
  evidence.add(map_of(1), mostly(2, 0.9));
  evidence.release();
  evidence.add(map_of(0.15), mostly(3, 0.9));
  EXPECT_EQ(evidence.result(1).verdict, Verdict::too_shallow);
  EXPECT_EQ(evidence.result(5).presses, 0);
}

TEST(Evidence, JoinsAsManyContactsAsAreAskedFor) {
  Evidence evidence;
  for (int i = 0; i < 2; ++i) {
    evidence.add(map_of(1), mostly(3, 0.5));
    evidence.release();
  }
  evidence.add(map_of(0.1), mostly(5, 0.9));  // too shallow to count
  evidence.release();
  evidence.add(map_of(1), mostly(3, 0.5));
  EXPECT_EQ(evidence.result(1).presses, 1);
  EXPECT_NEAR(evidence.result(1).probabilities[3], 0.5, 1e-9);
  EXPECT_EQ(evidence.result(10).presses, 3);
  EXPECT_GT(evidence.result(3).probabilities[3], 0.98);
}

TEST(Evidence, ADeeperFrameReplacesShallowOnesOfItsContact) {
  Evidence evidence;
  evidence.add(map_of(0.4), mostly(1, 0.9));
  evidence.add(map_of(1.2), mostly(3, 0.9));
  evidence.add(map_of(0.5), mostly(1, 0.9));  // it is lifted
  EXPECT_NEAR(evidence.result(1).probabilities[3], 0.9, 1e-9);
}

// The same on every machine and with every version of OpenCV.
TEST(Network, AnswersAsWhenItWasTrained) {
  Network network;
  const auto output = network.run(touch_map(grid_of(values_of({}))));
  ASSERT_EQ(output.features.size(), 128U);
  EXPECT_EQ(Network::hash().size(), 64U);
  double sum = 0;
  for (const double p : output.probabilities) sum += p;
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_NEAR(output.probabilities[0], kGolden[0], 1e-4);
  EXPECT_NEAR(output.probabilities[kClasses], kGolden[1], 1e-4);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(output.features[i], kGolden[2 + i], 1e-4) << i;
}

TEST(RecognitionThread, AnswersUntilTheContactEnds) {
  RecognitionThread thread;
  v1::Recognition message;
  EXPECT_FALSE(thread.fill(1, message));
  const auto values = values_of({});
  thread.offer(grid_of(values), 17);
  thread.wait();
  ASSERT_TRUE(thread.fill(1, message));
  EXPECT_EQ(message.sequence(), 17U);
  EXPECT_EQ(message.model(), Network::hash());
  EXPECT_EQ(message.presses(), 1U);
  ASSERT_EQ(message.candidates_size(), 5);
  EXPECT_GE(message.candidates(0).probability(), message.candidates(1).probability());
  EXPECT_NEAR(message.score() + kGolden[1], 1, 1e-3);
  thread.release();
  EXPECT_FALSE(thread.fill(1, message));
}

TEST(TaughtObjects, ArePressesInAFolder) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "dtact_taught_objects";
  std::filesystem::remove_all(folder);
  EXPECT_TRUE(taught_names(folder / "absent").empty());
  std::vector<TouchMap> presses(3);
  presses[1].mm[7] = -0.5F;
  presses[2].mm[96 * 96 - 1] = 1.234F;
  write_presses(folder, "left lid", presses);
  EXPECT_EQ(taught_names(folder), std::vector<std::string>{"left lid"});
  const auto read = read_presses(folder, "left lid");
  ASSERT_EQ(read.size(), 3U);
  EXPECT_NEAR(read[1].mm[7], -0.5, 1e-6);
  EXPECT_NEAR(read[2].mm[96 * 96 - 1], 1.234, 1e-6);
  for (const char* name : {"", "../lid", ".lid", "a/b"}) {
    EXPECT_THROW(write_presses(folder, name, presses), std::runtime_error) << name;
  }
}

TEST(TaughtObjects, DamagedOnesAreNamedAndTheOthersStay) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "dtact_damaged_objects";
  std::filesystem::remove_all(folder);
  write_presses(folder, "whole", std::vector<TouchMap>(3));
  const std::string bytes = base::read_file(folder / "whole.png");
  std::string wrong_digest = bytes;
  wrong_digest[bytes.size() - 20] ^= 1;  // in the last chunk with pixels
  const auto write = [&](const char* name, std::string_view content) {
    base::write_file_atomically(folder / name, content);
  };
  write("cut off.png", bytes.substr(0, bytes.size() / 2));
  write("digest.png", wrong_digest);
  write("empty.png", "");
  write("grey.png", image::encode_png(image::Grey8{96, 96, std::vector<std::uint8_t>(96 * 96)}));
  write("text.png", "no picture");
  std::filesystem::create_directory(folder / "folder.png");
  std::filesystem::create_symlink("absent", folder / "link.png");
  ASSERT_EQ(::mkfifo((folder / "pipe.png").c_str(), 0600), 0);
  write("._whole.png", "of another system");
  write("\xFC.png", bytes);  // a name in Latin-1
  Network network;
  const TaughtFolder taught = load_taught(network, folder);
  ASSERT_EQ(taught.objects.size(), 1U);
  EXPECT_EQ(taught.objects[0].name, "whole");
  const std::vector<std::string> damaged = {"cut off", "digest", "empty", "folder",
                                            "grey",    "link",   "pipe",  "text"};
  ASSERT_EQ(taught.damaged.size(), damaged.size() + 1);
  EXPECT_EQ(taught.damaged.back(),
            (folder / "?.png").string() + " has a name that is not UTF-8: rename it");
  for (std::size_t i = 0; i < damaged.size(); ++i) {
    EXPECT_TRUE(taught.damaged[i].starts_with(file_of(folder, damaged[i]).string()) ||
                taught.damaged[i].starts_with("cannot read"))
        << taught.damaged[i];
    EXPECT_TRUE(taught.damaged[i].ends_with(": forget " + damaged[i] + ", or teach it again"))
        << taught.damaged[i];
  }
  EXPECT_THROW(prepare_to_write(folder, "folder"), std::runtime_error);
}

// A file that is copied into the folder may be seen before it is whole.
TEST(RecognitionThread, ReadsADamagedFileAgainWhenItChanges) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "dtact_changing_objects";
  std::filesystem::remove_all(folder);
  const auto values = values_of({});
  const std::vector<TouchMap> presses(3, touch_map(grid_of(values)));
  write_presses(folder, "first ball", presses);
  write_presses(folder, "second ball", presses);
  const std::string bytes = base::read_file(folder / "second ball.png");
  std::ofstream copy(folder / "second ball.png", std::ios::binary);
  copy << bytes.substr(0, 300) << std::flush;
  RecognitionThread thread(folder);
  const auto names = [&] {
    thread.offer(grid_of(values), 1);
    thread.wait();
    v1::Recognition message;
    std::vector<std::string> taught;
    if (!thread.fill(1, message)) return taught;
    for (const auto& candidate : message.candidates()) {
      if (candidate.taught()) taught.push_back(candidate.name());
    }
    return taught;
  };
  EXPECT_EQ(names(), std::vector<std::string>{"first ball"});
  copy << bytes.substr(300) << std::flush;
  EXPECT_EQ(names(), (std::vector<std::string>{"first ball", "second ball"}));
}

TEST(TaughtObjects, WinWithinTheirRadiusOnly) {
  Network network;
  const auto map_at = [](double deep_mm) {
    return touch_map(grid_of(values_of({.deep_mm = deep_mm})));
  };
  const std::vector<TouchMap> presses = {map_at(0.8), map_at(0.9), map_at(1)};
  const auto taught =
      std::make_shared<const std::vector<TaughtObject>>(1, teach(network, "my ball", presses));
  const auto candidate = [&](const TouchMap& map) {
    Evidence evidence;
    evidence.set_taught(taught);
    evidence.add(map, network.run(map));
    return evidence.result(1).candidates.front();
  };
  EXPECT_EQ(candidate(map_at(0.95)).name, "my ball");
  EXPECT_TRUE(candidate(map_at(0.95)).taught);
  EXPECT_FALSE(
      candidate(touch_map(grid_of(std::vector<std::int16_t>(kWidth * kHeight, 0)))).taught);
  std::vector<std::int16_t> flat(kWidth * kHeight, 0);
  for (int y = 30; y < 70; ++y) std::fill_n(flat.begin() + y * kWidth + 30, 50, 900);
  EXPECT_FALSE(candidate(touch_map(grid_of(flat))).taught);
}

// Two presses that resemble no other would else set a radius that takes in nearly everything.
TEST(TaughtObjects, AreNotEverythingWithTwoOddPresses) {
  Network network;
  const auto box = [](int width, int height) {
    std::vector<std::int16_t> values(kWidth * kHeight, 0);
    for (int y = 0; y < height; ++y) {
      std::fill_n(values.begin() + (20 + y) * kWidth + 20, width, 900);
    }
    return touch_map(grid_of(values));
  };
  std::vector<TouchMap> presses;
  for (const double deep_mm : {0.8, 0.83, 0.86, 0.89, 0.92, 0.95, 0.98, 1.0}) {
    presses.push_back(touch_map(grid_of(values_of({.deep_mm = deep_mm}))));
  }
  presses.push_back(box(60, 60));
  presses.push_back(box(70, 4));
  const TaughtObject object = teach(network, "three sides", presses);
  for (const std::size_t odd : {8U, 9U}) {
    EXPECT_GT(nearest(object, object.features[odd], odd), object.radius) << odd;
  }
}

}  // namespace
}  // namespace dtact::perceive
