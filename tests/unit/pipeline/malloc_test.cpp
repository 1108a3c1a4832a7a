#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/pipeline/pipeline.hpp"
#include "tests/fakes/fake_ring.hpp"
#include "tests/fakes/jpeg_camera.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/fakes/malloc_counter.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

/// JPEGs of the toy sensor, the last few of `count` pressed.
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

TEST(CaptureThread, AllocatesNothingAfterItsFirstHundredFrames) {
  if (!fakes::can_count_allocations()) GTEST_SKIP() << "the sanitizer brings its own malloc";
  std::atomic<std::uint64_t> grabbed{0};
  auto camera = std::make_unique<fakes::JpegCamera>(fakes::kToyWidth, fakes::kToyHeight,
                                                    payloads(60), [&](std::uint64_t delivered) {
                                                      // Runs on the capture thread: from here on
                                                      // its every allocation counts.
                                                      if (delivered == 100)
                                                        fakes::count_allocations(true);
                                                      grabbed = delivered;
                                                    });
  PipelineConfig config;
  config.fifo_priority = 0;
  config.lock_memory = false;
  config.reference.frames = 16;
  fakes::FakeRing::Handle ring;
  Pipeline pipeline(std::move(camera), std::make_unique<fakes::FakeRing>(ring),
                    fakes::toy_calibration(), config);
  pipeline.want(true, true);
  pipeline.start();
  // The network thread at work: frames fetched, contact events read, re-zero and light commands
  // given, so that the capture thread does all that it does in a long life.
  int contacts = 0;
  int answers = 0;
  bool depth = false;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  int commands = 0;
  while (grabbed < 600 && std::chrono::steady_clock::now() < deadline) {
    if (const DepthFrame* frame = pipeline.latest()) depth = depth || frame->has_depth;
    while (const auto event = pipeline.next_event()) {
      contacts += std::holds_alternative<ContactChanged>(*event) ? 1 : 0;
      answers += std::holds_alternative<CommandDone>(*event) ? 1 : 0;
    }
    if (grabbed > 150 && commands == 0) commands += pipeline.submit({1, Rezero{true}}) ? 1 : 0;
    if (grabbed > 300 && commands == 1) {
      hal::Light light;
      light.brightness = 250;
      commands += pipeline.submit({2, SetLight{light}}) ? 1 : 0;
    }
    if (grabbed > 450 && commands == 2) {
      commands += pipeline.submit({3, UseCalibration{fakes::toy_calibration()}}) ? 1 : 0;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  pipeline.stop();
  EXPECT_GE(grabbed, 600U);
  EXPECT_TRUE(depth);
  EXPECT_GT(contacts, 2);
  EXPECT_EQ(answers, 3);
  EXPECT_EQ(fakes::counted_allocations(), 0U);
}

}  // namespace
}  // namespace dtact::pipeline
