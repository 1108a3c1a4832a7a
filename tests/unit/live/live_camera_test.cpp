#include "hal/live/live_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/base/rt_thread.hpp"
#include "hal/live/source.hpp"
#include "tests/fakes/jpeg_maker.hpp"

namespace dtact::hal::live {
namespace {

using std::chrono::milliseconds;

constexpr int kSide = 16;
constexpr std::size_t kPixels = 256;

/// A source of grey frames that leases its payloads.
class LeasingSource final : public Source {
 public:
  ~LeasingSource() override { *destroyed = true; }

  [[nodiscard]] Format format() const noexcept override {
    Format f;
    f.width = width;
    f.height = height;
    f.bytes_per_line = width;
    f.full_range = full_range;
    f.zero_copy = true;
    f.encoding = encoding;
    return f;
  }
  void wait(std::int64_t deadline_ns) noexcept override {
    base::system_clock().sleep_until(deadline_ns);
  }
  DequeueStatus dequeue(FilledBuffer& out) noexcept override {
    if (stopped || broken) return DequeueStatus::failed;
    if (filled.empty()) return DequeueStatus::none;
    out.index = filled.front();
    filled.pop_front();
    ++taken;
    out.payload = std::span(memory[static_cast<std::size_t>(out.index)]).first(bytes);
    out.sequence = sequence++;
    out.timestamp_ns = base::system_clock().monotonic_ns();
    out.flagged = flagged;
    return DequeueStatus::filled;
  }
  [[nodiscard]] int queued() const noexcept override {
    return static_cast<int>(memory.size() + index_to_requeue.size()) - taken;
  }
  bool enqueue(int index) noexcept override {
    index_to_requeue.push_back(index);
    return true;
  }
  void stop() noexcept override { stopped = true; }
  std::string check_controls(std::vector<CameraControl>& /*controls*/) override {
    return moved ? "gain moved from 5 to 60 by itself" : "";
  }
  void change(const CameraChange& change, std::vector<CameraControl>& /*controls*/,
              CameraSettings& settings) override {
    settings.exposure_us->value = *change.exposure_us;
    if (after_change) std::exchange(after_change, nullptr)();
  }
  void change_before_use(const CameraChange& change, std::vector<CameraControl>& controls,
                         CameraSettings& settings) override {
    ++changes_before_use;
    this->change(change, controls, settings);
  }

  void fill(int index, std::uint8_t grey) {
    memory[static_cast<std::size_t>(index)].fill(grey);
    filled.push_back(index);
  }

  void fill(int index, const std::vector<std::uint8_t>& jpeg) {
    std::ranges::copy(jpeg, memory[static_cast<std::size_t>(index)].begin());
    bytes = jpeg.size();
    filled.push_back(index);
  }

  static constexpr std::size_t kRoom = 1024;
  int width = kSide;
  int height = kSide;
  Encoding encoding = Encoding::grey;
  std::size_t bytes = kPixels;  // of every payload
  bool full_range = true;
  bool broken = false;
  bool flagged = false;  // every payload: it is damaged
  bool stopped = false;
  std::atomic<bool> moved{false};  // asked for by another thread
  std::shared_ptr<bool> destroyed = std::make_shared<bool>(false);
  std::array<std::array<std::uint8_t, kRoom>, 3> memory{};
  std::deque<int> filled;
  std::vector<int> index_to_requeue;  // requeued buffers
  std::uint32_t sequence = 0;
  int taken = 0;
  int changes_before_use = 0;
  std::function<void()> after_change;
};

CameraConfig small() {
  CameraConfig c;
  c.width = c.height = kSide;
  c.fps = 60;
  return c;
}

/// A camera whose opener returns `source` until it is taken away.
struct Rig {
  std::shared_ptr<LeasingSource> source = std::make_shared<LeasingSource>();
  LiveCamera camera{small(), "test", "nothing yet", [this]() -> Opened {
                      if (!source) throw DeviceError(CameraState::busy, "busy: wait");
                      return {source, "the one", "GREY", {}};
                    }};
};

// Threads that libcamera starts inside inherit priority and pinning from the thread that opens.
TEST(LiveCamera, IsOpenedAnewOnAThreadThatIsNeitherPinnedNorRealTime) {
  const cpu_set_t allowed = base::allowed_cpus();
  cpu_set_t seen;
  CPU_ZERO(&seen);
  int policy = -1;
  auto source = std::make_shared<LeasingSource>();
  LiveCamera camera(small(), "test", "nothing yet", [&]() -> Opened {
    if (!source) throw DeviceError(CameraState::busy, "busy: wait");
    seen = base::allowed_cpus();
    policy = ::sched_getscheduler(0);
    return {source, "the one", "GREY", {}};
  });
  source->broken = true;
  camera.start();
  int last = 0;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &allowed)) last = cpu;
  }
  // FIFO is used where it is allowed; pinning always is.
  base::RtThread capture({.name = "capture", .cpu = last, .fifo_priority = 1}, [&] {
    Frame frame;
    (void)camera.grab(frame, milliseconds(20));
    source = std::make_shared<LeasingSource>();
    (void)camera.grab(frame, milliseconds(300));
  });
  capture.join();
  EXPECT_TRUE(CPU_EQUAL(&seen, &allowed));
  EXPECT_EQ(policy, SCHED_OTHER);
}

TEST(LiveCamera, RefusesToDecodeRawFramesAtASmallerSize) {
  CameraConfig config = small();
  config.decode_scale = 2;
  const auto source = std::make_shared<LeasingSource>();
  LiveCamera camera(config, "test", "nothing yet",
                    [&]() -> Opened { return {source, "the one", "GREY", {}}; });
  try {
    camera.start();
    FAIL() << "raw frames have one size";
  } catch (const ModeError& e) {
    EXPECT_NE(std::string(e.what()).find("camera.decode_scale = 2: the frames are GREY"),
              std::string::npos);
  }
}

TEST(LiveCamera, DecodesJpegsAtASmallerSize) {
  const std::vector<std::uint8_t> jpeg = fakes::make_jpeg(
      {.width = kSide, .height = kSide, .colour = false}, [](int, int) { return 90; });
  CameraConfig config = small();
  config.decode_scale = 4;
  const auto source = std::make_shared<LeasingSource>();
  source->encoding = Encoding::jpeg;
  LiveCamera camera(config, "test", "nothing yet",
                    [&]() -> Opened { return {source, "the one", "MJPEG", {}}; });
  camera.start();
  EXPECT_EQ(camera.info().width, kSide / 4);
  EXPECT_EQ(camera.info().decode_scale, 4);
  source->fill(0, jpeg);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.luma().width, kSide / 4);
  EXPECT_EQ(frame.luma().height, kSide / 4);
  EXPECT_NEAR(frame.luma().row(3)[3], 90, 1);
  EXPECT_EQ(frame.jpeg().size(), jpeg.size());
}

// Width and height differ, so that one in place of the other shows.
TEST(LiveCamera, FramesNeedNotBeSquare) {
  CameraConfig config = small();
  config.width = 32;
  config.height = 16;
  for (const int scale : {1, 2, 4}) {
    config.decode_scale = scale;
    const auto source = std::make_shared<LeasingSource>();
    source->width = 32;
    source->height = 16;
    source->encoding = Encoding::jpeg;
    LiveCamera camera(config, "test", "nothing yet",
                      [&]() -> Opened { return {source, "the one", "MJPEG", {}}; });
    camera.start();
    EXPECT_EQ(camera.info().width, 32 / scale);
    EXPECT_EQ(camera.info().height, 16 / scale);
    EXPECT_EQ(camera.info().fps, 60);
    // The right half is bright.
    const std::vector<std::uint8_t> jpeg = fakes::make_jpeg(
        {.width = 32, .height = 16, .colour = false}, [](int x, int) { return x < 16 ? 40 : 200; });
    ASSERT_LE(jpeg.size(), LeasingSource::kRoom);
    source->fill(0, jpeg);
    Frame frame;
    ASSERT_EQ(camera.grab(frame, milliseconds(100)), GrabStatus::ok);
    ASSERT_EQ(frame.luma().width, 32 / scale);
    ASSERT_EQ(frame.luma().height, 16 / scale);
    const int bottom = 16 / scale - 1;
    EXPECT_NEAR(frame.luma().row(bottom)[32 / scale - 1], 200, 3) << scale;
    EXPECT_NEAR(frame.luma().row(bottom)[0], 40, 3) << scale;
  }
  CameraConfig raw = config;
  raw.decode_scale = 1;
  const auto source = std::make_shared<LeasingSource>();
  source->width = 32;
  source->height = 16;
  source->bytes = 512;
  LiveCamera camera(raw, "test", "nothing yet",
                    [&]() -> Opened { return {source, "the one", "GREY", {}}; });
  camera.start();
  source->fill(0, 50);
  source->memory[0][15 * 32 + 31] = 99;
  Frame frame;
  ASSERT_EQ(camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.luma().width, 32);
  EXPECT_EQ(frame.luma().height, 16);
  EXPECT_EQ(frame.luma().row(15)[31], 99);
  frame.reset();
  source->bytes = 511;
  source->fill(0, 50);
  EXPECT_EQ(camera.grab(frame, milliseconds(100)), GrabStatus::damaged) << "a byte is missing";
}

TEST(LiveCamera, LendsFullRangeLumaWithoutACopy) {
  Rig rig;
  rig.camera.start();
  EXPECT_EQ(rig.camera.info().identity, "the one");
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.luma().data, rig.source->memory[0].data());
  EXPECT_TRUE(rig.source->index_to_requeue.empty());
  rig.source->fill(1, 60);
  rig.source->fill(2, 70);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.luma().data, rig.source->memory[2].data());
  EXPECT_EQ(rig.source->index_to_requeue,
            (std::vector<int>{0, 1}));  // the one before, and the one skipped
  frame.reset();
  EXPECT_EQ(rig.source->index_to_requeue, (std::vector<int>{0, 1, 2}));
}

TEST(LiveCamera, LendsTheJpegWithTheFrame) {
  const std::vector<std::uint8_t> jpeg = fakes::make_jpeg(
      {.width = kSide, .height = kSide, .colour = false}, [](int, int) { return 120; });
  ASSERT_LE(jpeg.size(), LeasingSource::kRoom);
  Rig rig;
  rig.source->encoding = Encoding::jpeg;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, jpeg);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.jpeg().data(), rig.source->memory[0].data());
  EXPECT_EQ(frame.jpeg().size(), jpeg.size());
  EXPECT_NEAR(frame.luma().row(3)[3], 120, 2);
  EXPECT_TRUE(rig.source->index_to_requeue.empty()) << "the driver must not write over it";
  rig.source->fill(1, jpeg);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.jpeg().data(), rig.source->memory[1].data());
  EXPECT_EQ(rig.source->index_to_requeue, (std::vector<int>{0}));
  frame.reset();
  EXPECT_EQ(rig.source->index_to_requeue, (std::vector<int>{0, 1}));
  EXPECT_TRUE(frame.jpeg().empty());
}

TEST(LiveCamera, CopiesWhatMustBeExpanded) {
  Rig rig;
  rig.source->full_range = false;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 235);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_NE(frame.luma().data, rig.source->memory[0].data());
  EXPECT_EQ(frame.luma().row(0)[0], 255);
  EXPECT_EQ(rig.source->index_to_requeue, (std::vector<int>{0}));
}

TEST(LiveCamera, AFrameOutlivesTheSourceItWasLentFrom) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  const std::shared_ptr<bool> destroyed = rig.source->destroyed;
  rig.source->stopped = true;
  rig.source.reset();
  Frame none;
  EXPECT_EQ(rig.camera.grab(none, milliseconds(250)), GrabStatus::unplugged);
  EXPECT_EQ(rig.camera.report().state, CameraState::busy);  // the opener's present answer
  EXPECT_EQ(rig.camera.report().fix, "busy: wait");
  EXPECT_FALSE(*destroyed);
  EXPECT_EQ(frame.luma().row(3)[3], 50);
  frame.reset();
  EXPECT_TRUE(*destroyed);
  EXPECT_EQ(rig.camera.report().disconnects, 1U);
}

// The capture thread keeps its frame while the camera is away; the next source uses the same buffer
// numbers.
TEST(LiveCamera, AFrameOfTheSourceBeforeGoesToNoOther) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  const auto before = rig.source;
  before->stopped = true;
  const auto after = rig.source = std::make_shared<LeasingSource>();
  after->fill(1, 60);
  Frame other;
  ASSERT_EQ(rig.camera.grab(other, milliseconds(1000)), GrabStatus::ok);
  other.reset();
  EXPECT_EQ(after->index_to_requeue, (std::vector<int>{1}));
  after->fill(0, 70);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.luma().row(3)[3], 70);
  EXPECT_EQ(before->index_to_requeue, (std::vector<int>{}));
  EXPECT_EQ(after->index_to_requeue, (std::vector<int>{1})) << "the buffer that is being read";
  frame.reset();
  EXPECT_EQ(after->index_to_requeue, (std::vector<int>{1, 0}));
}

// A device that is still open somewhere cannot be opened again.
TEST(LiveCamera, ALostSourceIsStoppedAtOnceThoughAFrameKeepsIt) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  rig.source->broken = true;
  const auto lost = std::exchange(rig.source, nullptr);
  Frame none;
  EXPECT_EQ(rig.camera.grab(none, milliseconds(20)), GrabStatus::unplugged);
  EXPECT_TRUE(lost->stopped);
}

TEST(LiveCamera, ANewSourcesCountIsNoGap) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.info().sequence, 1U);
  rig.source->stopped = true;
  rig.source = std::make_shared<LeasingSource>();
  rig.source->sequence = 500;
  rig.source->fill(1, 60);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.info().sequence, 2U);
  EXPECT_EQ(rig.camera.report().lost, 0U);
}

TEST(LiveCamera, AGapWithBuffersToFillIsTheCamerasLoss) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  rig.source->sequence += 4;
  rig.source->fill(1, 60);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.info().flags, kFrameAfterGap);
  EXPECT_EQ(frame.info().sequence, 6U);
  EXPECT_EQ(rig.camera.report().lost, 4U);
  EXPECT_EQ(rig.camera.report().skipped, 0U);
}

// The driver had no free buffer for the frames, because this process held all of them: the cable
// and the hub are not the cause.
TEST(LiveCamera, AGapWithoutABufferToFillIsSkippedNotLost) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  for (const int index : {0, 1, 2}) rig.source->fill(index, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(rig.camera.report().skipped, 2U);
  rig.source->sequence += 4;
  rig.source->fill(0, 60);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.info().flags, kFrameNormal);
  EXPECT_EQ(frame.info().sequence, 8U);
  EXPECT_EQ(rig.camera.report().lost, 0U);
  EXPECT_EQ(rig.camera.report().skipped, 6U);
  // Buffers are free again from here on.
  rig.source->sequence += 1;
  rig.source->fill(1, 70);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.info().flags, kFrameAfterGap);
  EXPECT_EQ(rig.camera.report().lost, 1U);
  EXPECT_EQ(rig.camera.report().skipped, 6U);
}

TEST(LiveCamera, AMovedControlIsTheFramesFlagUntilItStays) {
  Rig rig;
  rig.camera.start();
  const auto eventually = [&](std::uint32_t flags, const std::string& sentence) {
    for (int i = 0; i < 500; ++i) {  // looked at once a second
      Frame frame;
      rig.source->fill(0, 50);
      if (rig.camera.grab(frame, milliseconds(100)) != GrabStatus::ok) return false;
      if (frame.info().flags == flags && rig.camera.report().moved == sentence) return true;
      base::system_clock().sleep_until(base::system_clock().monotonic_ns() + 20'000'000);
    }
    return false;
  };
  rig.source->moved = true;
  EXPECT_TRUE(eventually(kFrameControlsMoved, "gain moved from 5 to 60 by itself"));
  rig.source->moved = false;
  EXPECT_TRUE(eventually(kFrameNormal, ""));
}

TEST(LiveCamera, SilenceIsAStallAndIsRestarted) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(rig.camera.grab(frame, milliseconds(200)), GrabStatus::timeout);
  EXPECT_EQ(rig.camera.report().state, CameraState::stalled);
  EXPECT_NE(rig.camera.report().fix.find("sends nothing"), std::string::npos);
  // The source is closed three seconds later; this one cannot be opened twice.
  GrabStatus status = GrabStatus::timeout;
  for (int i = 0; i < 1000 && !rig.source->stopped; ++i) {
    status = rig.camera.grab(frame, milliseconds(20));
  }
  EXPECT_TRUE(rig.source->stopped);
  EXPECT_NE(status, GrabStatus::ok);
}

// A frame format that slipped, or a cable after a disturbance: many come back by a restart.
TEST(LiveCamera, DamagedFramesOnlyAreAStallAndAreRestarted) {
  Rig rig;
  rig.camera.start();
  const std::shared_ptr<LeasingSource> damaged = rig.source;
  Frame frame;
  damaged->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  damaged->flagged = true;
  rig.source = std::make_shared<LeasingSource>();        // opened next
  for (int i = 0; i < 3000 && !damaged->stopped; ++i) {  // restarted after three seconds
    damaged->fill(1, 60);
    EXPECT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::damaged);
    base::system_clock().sleep_until(base::system_clock().monotonic_ns() + 10'000'000);
  }
  EXPECT_TRUE(damaged->stopped);
  EXPECT_EQ(rig.camera.grab(frame, milliseconds(20)), GrabStatus::timeout);
  EXPECT_EQ(rig.camera.report().state, CameraState::stalled);
  EXPECT_NE(rig.camera.report().fix.find("sends damaged frames only"), std::string::npos)
      << "it is open again, and nothing is better yet";
  rig.source->fill(2, 70);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.info().flags, kFrameAfterGap | kFrameReopened);
  EXPECT_EQ(rig.camera.report().state, CameraState::streaming);
  EXPECT_EQ(rig.camera.report().fix, "");
}

TEST(LiveCamera, ASlowCamerasFirstFrameIsWaitedFor) {
  const auto source = std::make_shared<LeasingSource>();
  CameraConfig slow = small();
  slow.fps = 0.25;
  LiveCamera camera{slow, "test", "nothing yet",
                    [&source]() -> Opened { return {source, "the one", "GREY", {}}; }};
  camera.start();
  Frame frame;
  EXPECT_EQ(camera.grab(frame, milliseconds(1100)), GrabStatus::timeout);
  EXPECT_NE(camera.report().state, CameraState::stalled);
  EXPECT_FALSE(source->stopped);
}

TEST(LiveCamera, TheFirstFrameAfterARestartSaysSo) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.info().flags, kFrameNormal);
  const std::shared_ptr<LeasingSource> stalled =
      std::exchange(rig.source, std::make_shared<LeasingSource>());
  rig.source->fill(1, 60);
  rig.source->fill(2, 70);
  GrabStatus status = GrabStatus::timeout;
  for (int i = 0; i < 1000 && status == GrabStatus::timeout; ++i) {
    status = rig.camera.grab(frame, milliseconds(20));
  }
  ASSERT_EQ(status, GrabStatus::ok) << "it was never unplugged";
  EXPECT_TRUE(stalled->stopped);
  EXPECT_EQ(frame.info().flags, kFrameAfterGap | kFrameReopened);
  rig.source->fill(1, 60);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  EXPECT_EQ(frame.info().flags, kFrameNormal);
}

// The previous camera's silence does not count for the reopened one.
TEST(LiveCamera, AReopenedCamerasFirstFrameIsWaitedFor) {
  Rig rig;
  rig.camera.start();
  Frame frame;
  rig.source->fill(0, 50);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(100)), GrabStatus::ok);
  rig.source->broken = true;
  const std::shared_ptr<LeasingSource> lost = std::exchange(rig.source, nullptr);
  ASSERT_EQ(rig.camera.grab(frame, milliseconds(150)), GrabStatus::unplugged);
  rig.source = std::make_shared<LeasingSource>();
  EXPECT_EQ(rig.camera.grab(frame, milliseconds(300)), GrabStatus::timeout);
  EXPECT_NE(rig.camera.report().state, CameraState::stalled);
}

/// Opens whatever `source` is then, a camera with an exposure of 100 to 10,000 µs.
Opener with_exposure(const std::shared_ptr<LeasingSource>& source) {
  return [&source]() -> Opened {
    const CameraSetting exposure{8000, 100, 10000};
    return {source, "the one", "GREY", {}, {.exposure_us = exposure, .gain = {}}};
  };
}

// Nobody takes its frames during the opening: a source that needs them to change must know.
TEST(LiveCamera, AReopenedCameraIsChangedBeforeItsFramesAreUsed) {
  auto source = std::make_shared<LeasingSource>();
  LiveCamera camera(small(), "test", "nothing yet", with_exposure(source));
  camera.start();
  camera.change({.exposure_us = 4000, .gain = {}});
  EXPECT_EQ(camera.info().settings.exposure_us->value, 4000);
  EXPECT_EQ(source->changes_before_use, 0);
  source->broken = true;
  source = std::make_shared<LeasingSource>();
  source->fill(0, 50);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(camera.info().settings.exposure_us->value, 4000);
  EXPECT_EQ(source->changes_before_use, 1);
}

TEST(LiveCamera, AChangeDuringAReopeningHoldsForTheNewConnection) {
  auto source = std::make_shared<LeasingSource>();
  LiveCamera camera(small(), "test", "nothing yet", with_exposure(source));
  camera.start();
  Frame frame;
  const auto first = source;
  first->after_change = [&] {
    first->broken = true;
    source = std::make_shared<LeasingSource>();
    source->fill(0, 50);
    EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  };
  camera.change({.exposure_us = 4000, .gain = {}});
  EXPECT_EQ(camera.info().settings.exposure_us->value, 4000);
}

TEST(LiveCamera, RefusesImpossibleRates) {
  CameraConfig c = small();
  c.fps = 0;
  EXPECT_THROW(LiveCamera(c, "test", "", [] { return Opened{}; }), std::runtime_error);
}

}  // namespace
}  // namespace dtact::hal::live
