#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>
#include <vector>

#include "daemon/pipeline/capture_loop.hpp"
#include "tests/fakes/fake_clock.hpp"
#include "tests/fakes/fake_ring.hpp"
#include "tests/fakes/toy_sensor.hpp"

// begin() sets the optionals.
// NOLINTBEGIN(bugprone-unchecked-optional-access,clang-analyzer-optin.performance.Padding)
namespace dtact::fakes {

/// The capture loop on the toy sensor, one frame at a time on the test's own thread and clock.
class SteppedLoop {
 public:
  explicit SteppedLoop(double fps = 60) : camera(*this, fps) {
    config.reference.frames = 16;
    exchange.wanted = pipeline::Wanted{.contact = true, .depth = true};
  }

  /// Call it once the configuration is set.
  void begin(const std::shared_ptr<const calibration::Calibration>& calibration,
             bool unusable = false) {
    light.emplace(std::make_unique<FakeRing>(ring), config.light, clock, exchange, &camera);
    std::unique_ptr<pipeline::ActiveCalibration> active;
    if (calibration) active = activated(calibration);
    loop.emplace(pipeline::CaptureParts{camera, *light, exchange, clock}, config, std::move(active),
                 unusable);
    loop->tracker().start();
  }
  [[nodiscard]] std::unique_ptr<pipeline::ActiveCalibration> activated(
      const std::shared_ptr<const calibration::Calibration>& calibration) {
    return pipeline::activate(calibration, camera.info(), config.reconstruction);
  }
  /// Submits a command for the next turn; false: the queue is full.
  [[nodiscard]] bool submit(decltype(pipeline::Command::what) what) {
    return exchange.commands.push(pipeline::Command{std::move(what)});
  }
  [[nodiscard]] bool use(const std::shared_ptr<const calibration::Calibration>& calibration,
                         std::uint64_t key = 0) {
    return submit(pipeline::UseCalibration{calibration, key, activated(calibration)});
  }

  /// One turn of the loop; true if it published a frame.
  bool step() {
    loop->tracker().settle();  // otherwise its result may come a frame sooner or later
    loop->step();
    pipeline::Event event;
    while (exchange.events.pop(event)) events.push_back(event);
    const pipeline::DepthFrame* const fetched = exchange.slot.fetch();
    if (fetched != nullptr) frame = fetched;
    return fetched != nullptr;
  }
  void step(int turns) {
    for (int i = 0; i < turns; ++i) (void)step();
  }
  bool until(const std::function<bool()>& done, int most = 400) {
    for (int i = 0; i < most; ++i) {
      (void)step();
      if (done()) return true;
    }
    return false;
  }
  bool until_fresh() {
    return until([this] { return frame != nullptr && frame->has_depth && frame->health.empty(); });
  }
  [[nodiscard]] pipeline::HealthSet health() const {
    pipeline::HealthSet set;
    for (int i = 0; i < pipeline::kHealthCount; ++i) {
      const auto each = static_cast<pipeline::Health>(i);
      set.set(each, (exchange.health.load() >> static_cast<unsigned>(i) & 1U) != 0);
    }
    return set;
  }
  template <typename T>
  [[nodiscard]] std::vector<T> all() const {
    std::vector<T> found;
    for (const pipeline::Event& event : events) {
      if (const auto* one = std::get_if<T>(&event)) found.push_back(*one);
    }
    return found;
  }

  struct Camera final : hal::Camera, private hal::FrameOwner {
    Camera(SteppedLoop& loop, double rate) : owner(loop) {
      description.backend = "toy";
      description.identity = "toy";
      description.width = kToyWidth;
      description.height = kToyHeight;
      description.fps = rate;
    }
    [[nodiscard]] hal::CameraInfo info() const override { return description; }
    [[nodiscard]] hal::CameraReport report() const override { return {}; }
    void start() override {}
    void change(const hal::CameraChange& /*change*/) override {
      if (refuses_changes) throw std::runtime_error("the toy refuses");
    }
    [[nodiscard]] hal::GrabStatus grab(hal::Frame& out,
                                       std::chrono::nanoseconds /*timeout*/) noexcept override {
      owner.clock.now += static_cast<std::int64_t>(1e9 * slower / description.fps);
      if (status != hal::GrabStatus::ok) return status;
      hal::FrameInfo grabbed;
      grabbed.sequence = sequence++;
      grabbed.timestamp_ns = owner.clock.now - delay_ns;
      grabbed.ready_ns = owner.clock.now;
      grabbed.meaning = meaning;
      grabbed.flags = std::exchange(flags, hal::kFrameNormal);
      toy_paint(scene, grabbed.sequence, pixels.data());
      out = hal::Frame(*this, 0, {pixels.data(), kToyWidth, kToyHeight, kToyWidth}, grabbed, jpeg);
      return hal::GrabStatus::ok;
    }
    void give_back(int /*index*/) noexcept override {}

    SteppedLoop& owner;
    hal::CameraInfo description;
    hal::GrabStatus status = hal::GrabStatus::ok;
    std::atomic<bool> refuses_changes{false};
    ToyScene scene;
    std::uint32_t flags = hal::kFrameNormal;  ///< Flags of the next frame.
    hal::TimestampMeaning meaning = hal::TimestampMeaning::start_of_exposure;
    double slower = 1;          ///< Factor on the period that its mode promises.
    std::int64_t delay_ns = 0;  ///< From a frame's timestamp to its arrival.
    std::uint64_t sequence = 0;
    std::vector<std::uint8_t> jpeg;  ///< Payload of every frame, independent of the scene.
    std::vector<std::uint8_t> pixels =
        std::vector<std::uint8_t>(std::size_t{kToyWidth} * kToyHeight + hal::kLumaPadding);
  };

  pipeline::PipelineConfig config;
  FakeClock clock;
  Camera camera;
  FakeRing::Handle ring;
  pipeline::Exchange exchange{prototype()};
  std::optional<pipeline::LightDriver> light;
  std::optional<pipeline::CaptureLoop> loop;
  const pipeline::DepthFrame* frame = nullptr;  ///< The newest frame.
  std::vector<pipeline::Event> events;

 private:
  static pipeline::DepthFrame prototype() {
    pipeline::DepthFrame frame;
    frame.depth_um.resize(std::size_t{kToyWidth} * kToyHeight);
    frame.luma.resize(frame.depth_um.size());
    frame.jpeg.resize(100);
    return frame;
  }
};

}  // namespace dtact::fakes
// NOLINTEND(bugprone-unchecked-optional-access,clang-analyzer-optin.performance.Padding)
