#include "hal/live/search_throttle.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "hal/live/source.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::hal::live {
namespace {

using namespace std::chrono_literals;

TEST(SearchThrottle, LooksSeldomUnlessNodesAreNew) {
  const std::filesystem::path devices = fakes::own_path();
  std::filesystem::remove_all(devices);
  std::filesystem::create_directories(devices);
  const std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
  const auto date = [] { return std::chrono::system_clock::now(); };
  SearchThrottle pace(devices);
  EXPECT_TRUE(pace.due(begin, date()));
  EXPECT_FALSE(pace.due(begin + 100ms, date()));
  EXPECT_FALSE(pace.due(begin + 1999ms, date()));
  EXPECT_TRUE(pace.due(begin + 2s, date()));
  EXPECT_FALSE(pace.due(begin + 3s, date()));

  std::ofstream(devices / "sda").close();
  EXPECT_FALSE(pace.due(begin + 3s, date()));
  // A change before the date is read is at most this old.
  const std::chrono::system_clock::time_point made = date();
  std::ofstream(devices / "media0").close();
  EXPECT_TRUE(pace.due(begin + 3s, made + 1s));
  EXPECT_TRUE(pace.due(begin + 3100ms, made + 1s));
  EXPECT_FALSE(pace.due(begin + 3200ms, made + 1h));
  EXPECT_FALSE(pace.due(begin + 3200ms, made - 1h));
  std::filesystem::remove_all(devices);
}

TEST(SearchThrottle, LooksSeldomWithoutAFolderOfDevices) {
  SearchThrottle pace("/nonexistent");
  const std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
  EXPECT_TRUE(pace.due(begin, std::chrono::system_clock::now()));
  EXPECT_FALSE(pace.due(begin + 1s, std::chrono::system_clock::now()));
}

// The second of several attempts looks; the others report what it found.
TEST(Paced, FailsWithoutALookUntilItIsTime) {
  int looks = 0;
  const Opener open = paced(
      [&]() -> Opened {
        ++looks;
        throw DeviceError(CameraState::busy, "another program uses it: end it");
      },
      SearchThrottle("/nonexistent"));
  for (int i = 0; i < 5; ++i) {
    try {
      (void)open();
      ADD_FAILURE();
    } catch (const DeviceError& e) {
      EXPECT_EQ(e.state(), CameraState::busy);
      EXPECT_STREQ(e.what(), "another program uses it: end it");
    }
  }
  EXPECT_EQ(looks, 1);
}

TEST(Paced, ACameraThatWasOpenIsLookedForAtOnce) {
  int looks = 0;
  const Opener open = paced(
      [&]() -> Opened {
        ++looks;
        return {};
      },
      SearchThrottle("/nonexistent"));
  (void)open();
  (void)open();
  EXPECT_EQ(looks, 2);
}

}  // namespace
}  // namespace dtact::hal::live
