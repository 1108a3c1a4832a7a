#include "clients/recording/recorder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <mutex>

#include "clients/recording/channels.hpp"
#include "clients/recording/read_recording.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/recording/sample.hpp"

namespace dtact::recording {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

class RecorderTest : public testing::Test {
 public:
  ~RecorderTest() override { fs::remove(path_); }

 protected:
  fs::path path_ = fakes::own_path(".mcap");
  struct Seen {
    std::vector<std::uint64_t> frames;
    int events = 0;
    std::string damage;
  };
  [[nodiscard]] Seen read() const {
    Seen seen;
    const mcap::Reader reader(path_);
    seen.damage = reader.damage();
    RecordingHandlers handlers;
    handlers.frame = [&](const v1::Frame& frame, std::uint64_t) {
      seen.frames.push_back(frame.sequence());
      return true;
    };
    handlers.event = [&](const v1::Event&, std::uint64_t) { return ++seen.events > 0; };
    read_recording(reader, handlers);
    return seen;
  }
};

v1::Event event() {
  v1::Event event;
  event.mutable_state()->set_state(v1::STATE_SERVING);
  return event;
}

/// A disk that accepts nothing until it is released.
class StuckDisk final : public mcap::Sink {
 public:
  explicit StuckDisk(const fs::path& path) : file_(path, true) {}
  void get_stuck() {
    stuck_.lock();
    sticks_ = true;
  }
  void let_go() { stuck_.unlock(); }
  void append(std::string_view bytes) override {
    if (sticks_) {
      const std::scoped_lock wait(stuck_);
    }
    file_.append(bytes);
  }
  void sync() override {}

 private:
  mcap::FileSink file_;
  std::mutex stuck_;
  std::atomic<bool> sticks_ = false;
};

TEST_F(RecorderTest, ASlowDiskDropsFramesAndNoEvents) {
  StuckDisk disk(path_);
  // Some 14 of them are a chunk, which is written at once; the writer then blocks.
  const auto large = [](std::uint64_t sequence) {
    v1::Frame frame = sample_frame(sequence);
    frame.mutable_jpeg()->set_data(std::string(300'000, 'x'));
    return frame;
  };
  Recorder recorder(disk, {.program = "test"}, 20 * large(100).ByteSizeLong());
  disk.get_stuck();
  for (std::uint64_t i = 0; i < 100; ++i) {
    recorder.add(large(100 + i));
    recorder.add(event());
  }
  const auto counts = recorder.counts();
  EXPECT_EQ(counts.frames + counts.dropped, 100U);
  EXPECT_GE(counts.dropped, 50U);
  disk.let_go();
  recorder.finish();
  const Seen seen = read();
  EXPECT_EQ(seen.damage, "");
  EXPECT_EQ(seen.frames.size(), counts.frames);
  EXPECT_EQ(seen.frames.front(), 100U);
  EXPECT_EQ(seen.events, 100);
}

TEST_F(RecorderTest, AFullDiskEndsItAndLeavesTheFileReadable) {
  // Room for the schemas, some chunks and not for the last.
  SmallDisk disk(path_, 200'000);
  Recorder recorder(disk, {.program = "test"});
  std::uint64_t sequence = 0;
  unsigned noise = 1;
  while (!recorder.failed()) {
    v1::Frame frame = sample_frame(sequence++);
    for (int i = 0; i < 100'000; ++i) {
      noise = noise * 1664525U + 1013904223U;
      *frame.mutable_jpeg()->mutable_data() += static_cast<char>(noise >> 24U);
    }
    recorder.add(frame);
  }
  EXPECT_THAT([&] { recorder.finish(); },
              ThrowsMessage<std::system_error>(HasSubstr("No space left on device")));
  const Seen seen = read();
  EXPECT_EQ(seen.damage, "");  // the summary fitted
  EXPECT_EQ(recorder.counts().frames, seen.frames.size());
  EXPECT_LT(seen.frames.size(), sequence);
}

TEST_F(RecorderTest, WithoutFinishTheIndexIsMissing) {
  {
    mcap::FileSink sink(path_, true);
    Recorder recorder(sink, {.program = "test"});
    recorder.add(sample_frame(0));
  }
  EXPECT_NE(mcap::Reader(path_).damage(), "");
}

}  // namespace
}  // namespace dtact::recording
