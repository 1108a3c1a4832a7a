#include "hal/libcamera/skip_frames.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace dtact::hal::libcamera_backend {
namespace {

using live::DequeueStatus;

constexpr std::int64_t kLong = std::numeric_limits<std::int64_t>::max();

/// Returns the statuses in turn, `none` after the last; frame n is in buffer n.
class Script final : public live::Source {
 public:
  explicit Script(std::vector<DequeueStatus> statuses) : statuses_(std::move(statuses)) {}

  [[nodiscard]] live::Format format() const noexcept override { return {}; }
  void wait(std::int64_t /*deadline_ns*/) noexcept override { ++waits; }
  [[nodiscard]] DequeueStatus dequeue(live::FilledBuffer& out) noexcept override {
    if (next_ == statuses_.size()) return DequeueStatus::none;
    out.index = static_cast<int>(next_);
    return statuses_[next_++];
  }
  [[nodiscard]] int queued() const noexcept override { return 4; }
  [[nodiscard]] bool enqueue(int index) noexcept override {
    home.push_back(index);
    return true;
  }
  void stop() noexcept override {}
  [[nodiscard]] std::string check_controls(std::vector<CameraControl>& /*controls*/) override {
    return {};
  }

  int waits = 0;
  std::vector<int> home;

 private:
  std::vector<DequeueStatus> statuses_;
  std::size_t next_ = 0;
};

TEST(SkipFrames, HandsBackAsManyAsAsked) {
  Script source(
      {DequeueStatus::filled, DequeueStatus::none, DequeueStatus::filled, DequeueStatus::filled});
  EXPECT_TRUE(skip_frames(source, 2, kLong, [] { return true; }));
  EXPECT_EQ(source.home, (std::vector<int>{0, 2}));
  EXPECT_EQ(source.waits, 1);
}

TEST(SkipFrames, EndsWithTheStreamOrTheTime) {
  Script failing({DequeueStatus::filled, DequeueStatus::failed});
  EXPECT_FALSE(skip_frames(failing, 2, kLong, [] { return true; }));
  EXPECT_EQ(failing.home, (std::vector<int>{0}));
  Script silent({});
  EXPECT_FALSE(skip_frames(silent, 2, 0, [] { return true; }));
}

TEST(SkipFrames, TakesNoMoreThanIsWorthIt) {
  Script source({DequeueStatus::filled, DequeueStatus::filled});
  EXPECT_FALSE(skip_frames(source, 2, kLong, [] { return false; }));
  EXPECT_EQ(source.home, (std::vector<int>{0}));
}

}  // namespace
}  // namespace dtact::hal::libcamera_backend
