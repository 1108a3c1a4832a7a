#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/pipeline/pipeline.hpp"
#include "tests/fakes/fake_ring.hpp"
#include "tests/fakes/jpeg_camera.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/fakes/malloc_counter.hpp"
#include "tests/fakes/scattering_toy.hpp"

namespace dtact::pipeline {
namespace {

/// JPEGs of the toy sensor; the last few of `count` are pressed.
std::vector<std::vector<std::uint8_t>> payloads(int count) {
  std::vector<std::vector<std::uint8_t>> made;
  for (int i = 0; i < count; ++i) {
    fakes::ToyScene scene;
    scene.press_mm = i >= count - 10 ? 1 : 0;
    const fakes::ToyFrame frame(scene, static_cast<std::uint64_t>(i));
    const auto view = frame.view();
    made.push_back(fakes::make_jpeg(
        {.width = fakes::kToyWidth, .height = fakes::kToyHeight, .huffman_tables = false},
        [&](int x, int y) { return int{view.row(y)[x]}; }));
  }
  return made;
}

/// Page faults of the calling thread so far.
std::array<long, 2> faults() {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return {usage.ru_minflt, usage.ru_majflt};
}

/// A pipeline on a camera of JPEGs. The test plays the network thread: it fetches frames, reads
/// events, and sends a re-zero, a light command and another calibration at every `kEvery`-th frame
/// after the first, so that the capture thread does all of its work.
class CaptureThread : public ::testing::Test {
 protected:
  static constexpr std::uint64_t kEvery = 150;

  /// Calls `on_grab` on the capture thread before each frame, with the number delivered so far.
  void run(std::uint64_t frames, const std::function<void(std::uint64_t)>& on_grab,
           const ReconstructionRules& rules = {}) {
    std::atomic<std::uint64_t> grabbed{0};
    auto camera = std::make_unique<fakes::JpegCamera>(fakes::kToyWidth, fakes::kToyHeight,
                                                      payloads(60), [&](std::uint64_t delivered) {
                                                        on_grab(delivered);
                                                        grabbed = delivered;
                                                      });
    PipelineConfig config;
    config.fifo_priority = 0;
    config.lock_memory = false;
    config.reference.frames = 16;
    config.reconstruction = rules;
    fakes::FakeRing::Handle ring;
    Pipeline pipeline(std::move(camera), std::make_unique<fakes::FakeRing>(ring),
                      fakes::scattering_toy_calibration(15), config);
    pipeline.want({.contact = true, .depth = true, .luma = true, .jpeg = true});
    pipeline.start();
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (grabbed < frames && std::chrono::steady_clock::now() < deadline) {
      if (const DepthFrame* frame = pipeline.latest()) depth_ = depth_ || frame->has_depth;
      while (const auto event = pipeline.next_event()) {
        contacts_ += std::holds_alternative<ContactChanged>(*event) ? 1 : 0;
        answers_ += std::holds_alternative<CommandDone>(*event) ? 1U : 0U;
      }
      pipeline.want({.contact = true,
                     .depth = true,
                     .luma = commands_ % 2 == 0,  // whole frames and parts of them
                     .jpeg = true});
      if (grabbed > kEvery * (commands_ + 1))
        commands_ += pipeline.submit(next(pipeline)) ? 1U : 0U;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    pipeline.stop();
    EXPECT_GE(grabbed, frames);
    EXPECT_TRUE(depth_);
    EXPECT_GT(contacts_, 2);
    EXPECT_GE(answers_, 3U);
  }

 private:
  [[nodiscard]] Command next(const Pipeline& pipeline) const {
    switch (commands_ % 4) {
      case 0:
        return {Rezero{true}};
      case 1: {
        hal::Light light;
        light.brightness = 250;
        return {SetLight{light}};
      }
      case 2:
        return {CopyReference{}};
      default:
        return {pipeline.prepare(fakes::scattering_toy_calibration(15),
                                 pipeline.status().reconstruction)};
    }
  }

  std::uint64_t commands_ = 0;
  std::uint64_t answers_ = 0;
  int contacts_ = 0;
  bool depth_ = false;
};

/// Counts from the hundredth frame until shortly before the thread's end, which frees its own data.
std::function<void(std::uint64_t)> counting(std::uint64_t frames) {
  return [frames](std::uint64_t delivered) {
    if (delivered == 100) fakes::count_allocations(true);
    if (delivered + 10 == frames) fakes::count_allocations(false);
  };
}

// The run is two calibrations long.
TEST_F(CaptureThread, AllocatesAndFreesNothingAfterItsFirstHundredFrames) {
  if (!fakes::can_count_allocations()) GTEST_SKIP() << "the sanitizer brings its own malloc";
  run(1400, counting(1400));
  EXPECT_EQ(fakes::counted_allocations(), 0U);
}

TEST_F(CaptureThread, AllocatesAndFreesNothingWhileItSharpensMoreAndLess) {
  if (!fakes::can_count_allocations()) GTEST_SKIP() << "the sanitizer brings its own malloc";
  // The plain LUT counts as 50 um: the first frames are plain, the pressed ones sharpened.
  run(600, counting(600), {.sharpen = ReconstructionRules::kAutoSharpen, .max_error_um = 55});
  EXPECT_EQ(fakes::counted_allocations(), 0U);
}

TEST_F(CaptureThread, FaultsNoNewPageOnceItHasDoneEverything) {
  if (!fakes::can_count_allocations()) GTEST_SKIP() << "the sanitizer's shadow pages would count";
  // Code is mapped at its first execution: the first round of commands belongs to the warm-up.
  void* const fresh =
      ::mmap(nullptr, 1, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(fresh, MAP_FAILED);
  std::array<long, 2> warm{};
  std::array<long, 2> after{};
  std::array<long, 2> in_contact{};
  run(1200, [&](std::uint64_t delivered) {
    if (delivered == 600) warm = faults();
    if (delivered == 1200) {
      after = faults();
      *static_cast<volatile char*>(fresh) = 1;
      in_contact = faults();
    }
  });
  ::munmap(fresh, 1);
  EXPECT_EQ(in_contact[0] - after[0], 1);  // so they are counted here
  EXPECT_EQ(after[0] - warm[0], 0) << "minor";
  EXPECT_EQ(after[1] - warm[1], 0) << "major";
}

}  // namespace
}  // namespace dtact::pipeline
