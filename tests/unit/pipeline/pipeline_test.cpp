#include "daemon/pipeline/pipeline.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "daemon/pipeline/reference_store.hpp"
#include "tests/fakes/fake_camera.hpp"
#include "tests/fakes/fake_ring.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

namespace fs = std::filesystem;
using fakes::FakeCamera;
using Mode = FakeCamera::Mode;

/// The whole pipeline before a toy sensor whose ring lights it. The test is the network thread.
class PipelineTest : public ::testing::Test {
 protected:
  PipelineTest() {
    fs::remove_all(folder);
    config.fifo_priority = 0;
    config.lock_memory = false;
    config.reference.frames = 16;
    config.state_folder = folder;
    ring.on_show = [this](const hal::Light& light) { camera.light(light.brightness / 255.0); };
  }

 public:
  ~PipelineTest() override {
    pipeline.reset();
    fs::remove_all(folder);
  }

 protected:
  void build(const std::shared_ptr<const calibration::Calibration>& calibration) {
    pipeline =
        std::make_unique<Pipeline>(std::make_unique<FakeCamera>(camera),
                                   std::make_unique<fakes::FakeRing>(ring), calibration, config);
    pipeline->want(true, false);
  }
  void start(const std::shared_ptr<const calibration::Calibration>& calibration) {
    build(calibration);
    pipeline->start();
  }

  /// Fetches what comes until `done` says so; false after a generous deadline.
  bool until(const std::function<bool()>& done) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (std::chrono::steady_clock::now() < deadline) {
      while (auto event = pipeline->next_event()) events.push_back(std::move(*event));
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
  /// Serving, with a frame that was exposed after this call.
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
    const std::uint64_t ticket = ++tickets;
    EXPECT_TRUE(pipeline->submit({ticket, std::move(what)}));
    std::optional<CommandDone> answer;
    EXPECT_TRUE(until([&] {
      for (const Event& event : events) {
        const auto* done = std::get_if<CommandDone>(&event);
        if (done != nullptr && done->ticket == ticket) answer = *done;
      }
      return answer.has_value();
    }));
    return answer.value_or(CommandDone{});
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

  fs::path folder = fs::path(::testing::TempDir()) /
                    (std::string("dtact_pipeline_") +
                     ::testing::UnitTest::GetInstance()->current_test_info()->name());
  PipelineConfig config;
  FakeCamera::Handle camera;
  fakes::FakeRing::Handle ring;
  std::unique_ptr<Pipeline> pipeline;
  std::vector<Event> events;
  const DepthFrame* frame = nullptr;
  std::uint64_t tickets = 0;
};

TEST_F(PipelineTest, ServesDepthAfterItsSequence) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(frame->width, 144);
  EXPECT_EQ(frame->height, 104);
  EXPECT_EQ(frame->depth_um.size(), 144U * 104U);
  EXPECT_DOUBLE_EQ(frame->mm_per_px, 0.2);
  EXPECT_FALSE(frame->has_luma);
  EXPECT_FALSE(frame->contact.touching);
  // CLOCK_REALTIME of the same moment: within a second of now.
  EXPECT_LT(std::abs(base::system_clock().wall_ns() - frame->wall_ns), 1'000'000'000);
  const auto references = all<ReferenceTaken>();
  ASSERT_EQ(references.size(), 1U);
  EXPECT_FALSE(references[0].restored);
  const auto states = all<StateChanged>();
  ASSERT_GE(states.size(), 3U);
  EXPECT_EQ(states.front().state, State::settling);
  EXPECT_TRUE(states.front().health.has(Health::starting));
  EXPECT_EQ(states.back().state, State::serving);
  EXPECT_TRUE(states.back().health.empty());
}

TEST_F(PipelineTest, MeasuresAPressAndTellsContact) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.touching; }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.05);
  // Pixel (80, 60) of the frame is (72, 52) of the map, half a pixel right and down of its centre.
  EXPECT_NEAR(frame->contact.x_mm, 0.1, 0.05);
  EXPECT_NEAR(frame->contact.y_mm, 0.1, 0.05);
  camera.press(0);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return !f.contact.touching; }));
  ASSERT_TRUE(until([&] { return all<ContactChanged>().size() == 2; }));
  EXPECT_TRUE(all<ContactChanged>()[0].touching);
  EXPECT_FALSE(all<ContactChanged>()[1].touching);
}

TEST_F(PipelineTest, ACoarserMapHoldsTheSameSurface) {
  config.reconstruction.decimation = 4;
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(frame->width, 36);  // 144×104 pixels of 0.2 mm at full resolution
  EXPECT_EQ(frame->height, 26);
  EXPECT_EQ(frame->depth_um.size(), 36U * 26U);
  EXPECT_DOUBLE_EQ(frame->mm_per_px, 0.8);
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.touching; }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.05);
  EXPECT_NEAR(frame->contact.x_mm, 0.1, 0.1);
  EXPECT_NEAR(frame->contact.y_mm, 0.1, 0.1);
}

TEST_F(PipelineTest, AutoTakesTheCoarsestMapWithinTheBound) {
  config.reconstruction.decimation = 0;
  config.reconstruction.max_error_um = 1000;
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth && f.decimation == 4; }));
  EXPECT_EQ(frame->width, 36);
  EXPECT_NEAR(frame->uncertainty_um, 20, 1);  // a list that says nothing of itself, nothing pressed
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.touching; }));
  EXPECT_GT(frame->uncertainty_um, 20);
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.05);
}

TEST_F(PipelineTest, AutoTakesFullResolutionWhereTheBoundIsOutOfReach) {
  config.reconstruction.decimation = 0;
  config.reconstruction.max_error_um = 10;
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth && f.decimation == 1; }));
  EXPECT_EQ(frame->width, 144);
}

TEST_F(PipelineTest, LumaIsWholeThoughDepthReadsAPart) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  pipeline->want(true, true);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_luma; }));
  EXPECT_TRUE(frame->has_depth);
  EXPECT_GT(frame->luma.front(), 90);  // the corner, outside the map; unread it is 0
  EXPECT_GT(frame->luma.back(), 90);
}

TEST_F(PipelineTest, KeepsTheReferenceForATouchedStart) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  pipeline.reset();  // writes it out
  ASSERT_TRUE(
      load_reference(*fakes::toy_calibration(), fakes::kToyWidth, fakes::kToyHeight, folder));
  events.clear();
  frame = nullptr;
  camera.press(1);
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) {
    return f.has_depth && f.health.has(Health::reference_restored) && f.contact.touching;
  }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.06);
  ASSERT_TRUE(until([&] { return !all<ReferenceTaken>().empty(); }));
  EXPECT_TRUE(all<ReferenceTaken>()[0].restored);
  camera.press(0);
  ASSERT_TRUE(until_fresh());
  EXPECT_FALSE(all<ReferenceTaken>().back().restored);
}

TEST_F(PipelineTest, TouchedFirstStartScalesTheCalibrations) {
  camera.press(1);
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) {
    return f.has_depth && f.health.has(Health::reference_stale) && f.contact.touching;
  }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.06);
  EXPECT_FALSE(fs::exists(folder / "reference.png"));
}

TEST_F(PipelineTest, RezeroUnderContactIsRefusedUnlessForced) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(ask(Rezero{}).outcome, Outcome::done);
  camera.press(0.5);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.touching; }));
  const CommandDone refused = ask(Rezero{});
  EXPECT_EQ(refused.outcome, Outcome::refused_contact);
  EXPECT_EQ(refused.message, "something touches: lift it and ask again, or force it");
  EXPECT_EQ(ask(Rezero{.force = true}).outcome, Outcome::done);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) {
    return f.has_depth && !f.contact.touching && f.contact.deepest_mm < 0.1;
  }));
}

TEST_F(PipelineTest, HalvedLightReadsTheSameDepthAfterANewReference) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(ask(SetLight{dimmed(128)}).outcome, Outcome::done);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth; }));
  // A calibration under full light, so that much stays to be said.
  EXPECT_TRUE(frame->health.has(Health::light_mismatch));
  EXPECT_FALSE(frame->health.has(Health::reference_stale));
  EXPECT_EQ(frame->light.brightness, 128);
  ASSERT_TRUE(until([&] { return all<ReferenceTaken>().size() == 2; }));
  ASSERT_EQ(all<LightChanged>().size(), 1U);
  EXPECT_EQ(all<LightChanged>()[0].light.brightness, 128);
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.touching; }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.1);
}

TEST_F(PipelineTest, FramesOfALightChangeCarryNoDepth) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  const std::int64_t before = base::system_clock().monotonic_ns();
  EXPECT_EQ(ask(SetLight{dimmed(100)}).outcome, Outcome::done);
  int unsettled = 0;
  ASSERT_TRUE(until([&] {
    if (frame == nullptr || frame->camera.timestamp_ns < before) return false;
    if (!frame->has_depth) {
      EXPECT_TRUE(frame->health.has(Health::light_unsettled));
      ++unsettled;
    }
    return unsettled > 0 && frame->has_depth;
  }));
  EXPECT_FALSE(frame->health.has(Health::light_unsettled));
}

TEST_F(PipelineTest, ALightChangeUnderContactIsStaleUntilItLifts) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.touching; }));
  EXPECT_EQ(ask(SetLight{dimmed(128)}).outcome, Outcome::done);
  ASSERT_TRUE(until_frame(
      [](const DepthFrame& f) { return f.has_depth && f.health.has(Health::reference_stale); }));
  EXPECT_TRUE(frame->contact.touching);
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.12);
  camera.press(0);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) {
    return f.has_depth && !f.health.has(Health::reference_stale) && !f.contact.touching;
  }));
}

TEST_F(PipelineTest, ABrokenRingIsAConditionNotTheEnd) {
  ring.broken = true;
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth; }));
  EXPECT_TRUE(frame->health.has(Health::ring_trouble));
  const CommandDone failed = ask(SetLight{dimmed(10)});
  EXPECT_EQ(failed.outcome, Outcome::device_error);
  EXPECT_EQ(failed.message, "the fake ring is broken: mend it");
  EXPECT_EQ(pipeline->status().ring_message, "the fake ring is broken: mend it");
}

TEST_F(PipelineTest, WithoutCalibrationThereIsLuma) {
  start(nullptr);
  pipeline->want(false, true);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_luma; }));
  EXPECT_FALSE(frame->has_depth);
  EXPECT_TRUE(frame->health.has(Health::uncalibrated));
  EXPECT_EQ(frame->luma_width, 160);
  EXPECT_EQ(frame->luma.size(), 160U * 120U);
  EXPECT_NEAR(frame->luma[60 * 160 + 80], 150, 1);
  ASSERT_TRUE(until_state(State::uncalibrated));
  EXPECT_EQ(pipeline->status().calibration, nullptr);
  const CommandDone refused = ask(Rezero{});
  EXPECT_EQ(refused.outcome, Outcome::invalid);
  EXPECT_NE(refused.message.find("dtactctl calibrate"), std::string::npos);
}

TEST_F(PipelineTest, ACalibrationCanComeLaterAndBeReplaced) {
  start(nullptr);
  ASSERT_TRUE(until_state(State::uncalibrated));
  EXPECT_EQ(ask(UseCalibration{fakes::toy_calibration()}).outcome, Outcome::done);
  ASSERT_TRUE(until_fresh());
  auto second = fakes::toy_calibration();
  second->name = "second";
  EXPECT_EQ(ask(UseCalibration{second}).outcome, Outcome::done);
  ASSERT_TRUE(until_fresh());  // at once: the reference is the sensor's, not the calibration's
  EXPECT_EQ(pipeline->status().calibration->name, "second");
  EXPECT_EQ(all<ReferenceTaken>().size(), 1U);
}

TEST_F(PipelineTest, ACalibrationOfAnotherModeIsRefused) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  auto other = fakes::toy_calibration();
  auto model = std::make_shared<recon::Model>(*other->model);
  model->rectify = recon::make_crop_table(320, 240, 0, 0, 320, 240);
  model->reference_q8.assign(std::size_t{320} * 240, 30000);
  other->model = model;
  const CommandDone refused = ask(UseCalibration{other});
  EXPECT_EQ(refused.outcome, Outcome::invalid);
  EXPECT_NE(refused.message.find("320x240"), std::string::npos) << refused.message;
  EXPECT_EQ(ask(UseCalibration{nullptr}).outcome, Outcome::invalid);
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(pipeline->status().calibration->name, "toy");
  pipeline.reset();
  // At start the same is a condition: luma flows.
  start(other);
  ASSERT_TRUE(until_state(State::uncalibrated));
  EXPECT_TRUE(pipeline->status().health.has(Health::camera_mismatch));
  EXPECT_NE(pipeline->status().storage_message.find("320x240"), std::string::npos);
}

TEST_F(PipelineTest, UnpluggedAndBack) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.mode = Mode::unplugged;
  ASSERT_TRUE(until_state(State::camera_lost));
  EXPECT_TRUE(pipeline->status().health.has(Health::camera_trouble));
  EXPECT_EQ(pipeline->status().camera_report.remedy, "plug the fake camera in");
  EXPECT_EQ(ask(Rezero{}).outcome, Outcome::camera_away);
  camera.mode = Mode::streaming;
  ASSERT_TRUE(until_fresh());
  ASSERT_TRUE(until_state(State::serving));
  ASSERT_TRUE(until([&] { return all<ReferenceTaken>().size() == 2U; }));
}

TEST_F(PipelineTest, ASilentCameraIsTroubleAndAnswersStillCome) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.mode = Mode::silent;
  ASSERT_TRUE(until([&] { return pipeline->status().health.has(Health::camera_trouble); }));
  EXPECT_EQ(pipeline->status().state, State::serving);
  EXPECT_EQ(ask(Rezero{}).outcome, Outcome::camera_away);
  camera.mode = Mode::streaming;
  ASSERT_TRUE(until_fresh());
}

TEST_F(PipelineTest, LostAndDamagedFramesAreAConditionForASecond) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.lose = 3;
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.health.has(Health::frames_lost); }));
  ASSERT_TRUE(until_fresh());
  camera.damage = 1;
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.health.has(Health::frames_lost); }));
}

TEST_F(PipelineTest, DeeperThanTheListIsACondition) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.press(3);  // the list ends at 70 grey levels, 2.2 mm
  ASSERT_TRUE(
      until_frame([](const DepthFrame& f) { return f.health.has(Health::beyond_calibration); }));
  EXPECT_LT(frame->contact.deepest_mm, 2.3);
}

TEST_F(PipelineTest, AFullEventQueueLosesNoAnswerAndNoState) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  // Nobody reads events while contact comes and goes more often than the queue is long.
  for (int i = 0; i < 80; ++i) {
    camera.press(i % 2 == 0 ? 1 : 0);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  camera.press(1);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ASSERT_TRUE(pipeline->submit({777, Rezero{}}));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ASSERT_TRUE(until([&] {
    const auto answers = all<CommandDone>();
    return !answers.empty() && answers.back().ticket == 777;
  }));
  ASSERT_TRUE(until([&] { return all<ContactChanged>().back().touching; }));
  const auto changes = all<ContactChanged>();
  for (std::size_t i = 1; i < changes.size(); ++i) {
    EXPECT_NE(changes[i].touching, changes[i - 1].touching) << i;
  }
}

TEST_F(PipelineTest, TheNewestFrameWinsAndTheOthersAreCounted) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  const std::uint64_t before = pipeline->status().skipped;
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const DepthFrame* newest = pipeline->latest();
  ASSERT_NE(newest, nullptr);
  EXPECT_GT(pipeline->status().skipped, before);
  EXPECT_GT(newest->skipped, before);
}

TEST_F(PipelineTest, WithoutSubscribersNothingIsPublishedButContactIsTold) {
  build(fakes::toy_calibration());
  pipeline->want(false, false);
  pipeline->start();
  ASSERT_TRUE(until([&] { return !all<ReferenceTaken>().empty(); }));
  camera.press(1);
  ASSERT_TRUE(until([&] { return !all<ContactChanged>().empty(); }));
  EXPECT_EQ(frame, nullptr);
  EXPECT_EQ(pipeline->status().frames, 0U);
}

TEST_F(PipelineTest, StatusHasStagesAndRate) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  ASSERT_TRUE(until([&] { return pipeline->status().fps > 0; }));
  const Status status = pipeline->status();
  ASSERT_EQ(status.stages.size(), 8U);
  EXPECT_EQ(status.stages[3].stage, "smooth");
  // Nothing touches, so nothing is smoothed; the look at the frame takes its time all the same.
  EXPECT_EQ(status.stages[1].stage, "activity");
  EXPECT_GT(status.stages[1].p50_us, 0);
  EXPECT_EQ(status.stages[7].stage, "total");
  EXPECT_GT(status.stages[7].p50_us, 0);
  EXPECT_EQ(status.camera.identity, "fake camera");
  EXPECT_EQ(status.ring.identity, "fake ring");
  EXPECT_TRUE(status.realtime.empty());
  EXPECT_GT(status.frames, 0U);
}

TEST_F(PipelineTest, RefusedRealTimeIsSaidAndSurvived) {
  config.fifo_priority = 1;
  config.cpu = 1000;  // no machine has it
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth; }));
  const Status status = pipeline->status();
  ASSERT_FALSE(status.realtime.empty());
  EXPECT_NE(status.realtime[0].find("CPU 1000"), std::string::npos);
  // Whether FIFO is granted depends on who runs the test; the condition follows the sentence.
  EXPECT_EQ(status.health.has(Health::not_realtime), status.realtime.size() == 2);
}

TEST_F(PipelineTest, StopsWhileTheCameraIsSilent) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.mode = Mode::silent;
  ASSERT_TRUE(until([&] { return pipeline->status().health.has(Health::camera_trouble); }));
  const auto began = std::chrono::steady_clock::now();
  pipeline->stop();
  // 0.1 s by design; the margin is for a busy machine.
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(5));
  EXPECT_EQ(camera.lent, 0);  // the last frame went home
}

TEST_F(PipelineTest, StopsWithoutHavingStarted) {
  build(fakes::toy_calibration());
  pipeline->stop();
  EXPECT_EQ(pipeline->latest(), nullptr);
  EXPECT_FALSE(pipeline->next_event());
}

TEST_F(PipelineTest, ACameraThatDoesNotStartIsAnError) {
  camera.refuse_start = true;
  build(fakes::toy_calibration());
  EXPECT_THROW(pipeline->start(), std::runtime_error);
}

TEST_F(PipelineTest, RefusesACameraItCannotUse) {
  camera.info.width = 60;
  EXPECT_THROW(build(nullptr), std::invalid_argument);
  camera.info.width = 160;
  camera.info.fps = 0;
  EXPECT_THROW(build(nullptr), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::pipeline
