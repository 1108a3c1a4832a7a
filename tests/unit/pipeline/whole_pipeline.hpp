#pragma once

#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "daemon/pipeline/pipeline.hpp"
#include "tests/fakes/fake_camera.hpp"
#include "tests/fakes/fake_ring.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {

/// The whole pipeline on a toy sensor lit by its ring. The test is the network thread.
class PipelineTest : public ::testing::Test {
 protected:
  PipelineTest() {
    std::filesystem::remove_all(folder);
    config.fifo_priority = 0;
    config.lock_memory = false;
    config.reference.frames = 16;
    config.state_folder = folder;
    ring.on_show = [this](const hal::Light& light) { camera.light(light.brightness / 255.0); };
  }

 public:
  ~PipelineTest() override {
    pipeline.reset();
    std::filesystem::remove_all(folder);
  }

 protected:
  void build(const std::shared_ptr<const calibration::Calibration>& calibration) {
    pipeline =
        std::make_unique<Pipeline>(std::make_unique<fakes::FakeCamera>(camera),
                                   std::make_unique<fakes::FakeRing>(ring), calibration, config);
    pipeline->want({.contact = true, .depth = true});
  }
  void start(const std::shared_ptr<const calibration::Calibration>& calibration) {
    build(calibration);
    pipeline->start();
  }

  /// Fetches frames and events until `done` returns true; false after a generous deadline.
  bool until(const std::function<bool()>& done) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (std::chrono::steady_clock::now() < deadline) {
      while (auto event = pipeline->next_event()) {
        const auto* answer = std::get_if<CommandDone>(&*event);
        if (answer != nullptr && answer->command.then) answer->command.then(*answer);
        events.push_back(std::move(*event));
      }
      if (const DepthFrame* newest = pipeline->latest()) frame = newest;
      if (done()) return true;
      pollfd poll{.fd = pipeline->event_fd(), .events = POLLIN, .revents = 0};
      if (::poll(&poll, 1, 20) > 0) {
        std::uint64_t count = 0;
        (void)!::read(poll.fd, &count, sizeof count);
      }
    }
    return false;
  }
  bool until_state(State state) {
    return until([&] { return pipeline->status().state == state; });
  }
  /// Waits for a frame that was exposed after this call and meets the predicate, while serving.
  bool until_frame(const std::function<bool(const DepthFrame&)>& like) {
    const std::int64_t from = base::system_clock().monotonic_ns();
    return until(
        [&] { return frame != nullptr && frame->camera.timestamp_ns > from && like(*frame); });
  }
  bool until_fresh() {
    return until_frame([](const DepthFrame& f) { return f.has_depth && f.health.empty(); });
  }
  /// Sends a command and waits for its answer.
  CommandDone ask(decltype(Command::what) what) {
    const auto answer = std::make_shared<std::optional<CommandDone>>();
    EXPECT_TRUE(pipeline->submit({std::move(what), [answer](const CommandDone& done) {
                                    *answer = done;
                                    (*answer)->command.then = nullptr;  // it holds the answer
                                  }}));
    EXPECT_TRUE(until([&] { return answer->has_value(); }));
    return answer->value_or(CommandDone{});
  }
  CommandDone use(const std::shared_ptr<const calibration::Calibration>& calibration) {
    return ask(pipeline->prepare(calibration, pipeline->status().reconstruction));
  }
  CommandDone reconstruct(const ReconstructionRules& rules) {
    return ask(pipeline->prepare_maps(pipeline->status().calibration, rules));
  }
  /// The message of the refusal; empty: it was accepted.
  static std::string refusal(const std::function<void()>& prepare) {
    try {
      prepare();
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return {};
  }
  template <typename T>
  std::vector<T> all() const {
    std::vector<T> found;
    for (const Event& event : events) {
      if (const auto* one = std::get_if<T>(&event)) found.push_back(*one);
    }
    return found;
  }
  static hal::Light dimmed(int brightness) {
    hal::Light light;
    light.brightness = static_cast<std::uint8_t>(brightness);
    return light;
  }

  std::filesystem::path folder = fakes::own_path();
  PipelineConfig config;
  fakes::FakeCamera::Handle camera;
  fakes::FakeRing::Handle ring;
  std::unique_ptr<Pipeline> pipeline;
  std::vector<Event> events;
  const DepthFrame* frame = nullptr;
};

}  // namespace dtact::pipeline
