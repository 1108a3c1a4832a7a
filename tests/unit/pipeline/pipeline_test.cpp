// What the whole pipeline serves: depth, references, light and calibrations.
#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>

#include "daemon/pipeline/reference/reference_store.hpp"
#include "tests/fakes/scattering_toy.hpp"
#include "tests/unit/pipeline/whole_pipeline.hpp"

namespace dtact::pipeline {
namespace {

namespace fs = std::filesystem;

TEST_F(PipelineTest, ServesDepthAfterItsSequence) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(frame->width, 144);
  EXPECT_EQ(frame->height, 104);
  EXPECT_EQ(frame->depth_um.size(), 144U * 104U);
  EXPECT_DOUBLE_EQ(frame->mm_per_px, 0.2);
  EXPECT_FALSE(frame->has_luma);
  EXPECT_FALSE(frame->contact.in_contact);
  // CLOCK_REALTIME of the same moment: within a second of now.
  EXPECT_LT(std::abs(base::system_clock().wall_ns() - frame->wall_ns), 1'000'000'000);
  // A frame is published before the event of the change.
  ASSERT_TRUE(until([&] {
    const auto reported = all<StateChanged>();
    return !reported.empty() && reported.back().state == State::serving &&
           reported.back().health.empty();
  }));
  const auto references = all<ReferenceTaken>();
  ASSERT_EQ(references.size(), 1U);
  EXPECT_FALSE(references[0].restored);
  const auto states = all<StateChanged>();
  ASSERT_GE(states.size(), 3U);
  EXPECT_EQ(states.front().state, State::settling);
  EXPECT_TRUE(states.front().health.has(Health::starting));
}

TEST_F(PipelineTest, SaysWhichCpuTheCaptureThreadIsPinnedTo) {
  config.cpu = ::sched_getcpu();
  start(fakes::toy_calibration());
  EXPECT_EQ(pipeline->status().cpu, config.cpu);
  config.cpu = 1000;  // there is none
  pipeline.reset();
  start(fakes::toy_calibration());
  EXPECT_EQ(pipeline->status().cpu, std::nullopt);
}

// A picture that never stands still is refused after timeout_frames in each of two phases.
TEST_F(PipelineTest, SaysHowLongARezeroMayTake) {
  config.reference.timeout_frames = 90;
  build(fakes::toy_calibration());
  const Status status = pipeline->status();
  EXPECT_DOUBLE_EQ(status.rezero_timeout_s, 1 + 2 * 90 / status.camera.fps);
}

TEST_F(PipelineTest, MeasuresAPressAndReportsContact) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.in_contact; }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.05);
  // Pixel (80, 60) of the frame is (72, 52) of the map, half a pixel right and down of its centre.
  EXPECT_NEAR(frame->contact.x_mm, 0.1, 0.05);
  EXPECT_NEAR(frame->contact.y_mm, 0.1, 0.05);
  camera.press(0);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return !f.contact.in_contact; }));
  ASSERT_TRUE(until([&] { return all<ContactChanged>().size() == 2; }));
  EXPECT_TRUE(all<ContactChanged>()[0].in_contact);
  EXPECT_FALSE(all<ContactChanged>()[1].in_contact);
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
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.in_contact; }));
  // The mean over 4×4 pixels around the peak, smoothed: 5 % below it.
  EXPECT_NEAR(frame->contact.deepest_mm, 0.95, 0.02);
  EXPECT_NEAR(frame->contact.x_mm, 0.1, 0.1);
  EXPECT_NEAR(frame->contact.y_mm, 0.1, 0.1);
}

TEST_F(PipelineTest, ASharpenedMapSaysHowItWasMade) {
  config.reconstruction.sharpen = 2;
  start(fakes::scattering_toy_calibration(15));
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(frame->sharpen_steps, 2);
  EXPECT_EQ(frame->made_decimation, 4);
  EXPECT_EQ(frame->decimation, 1);
  EXPECT_EQ(frame->width, 144);
  EXPECT_EQ(frame->height, 104);
  EXPECT_EQ(frame->depth_um.size(), 144U * 104U);
  EXPECT_DOUBLE_EQ(frame->mm_per_px, 0.2);
  EXPECT_NEAR(frame->uncertainty_um, 15, 0.1);
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.in_contact; }));
  // 0.937 plain, the press's mean over the deepest of the 4×4 pixels, smoothed; by Fourier
  // transform of the toy's picture (1 − (1 − h)³)/h times its spectrum, h the two Gaussians',
  // gives 1.379 there.
  EXPECT_NEAR(frame->contact.deepest_mm, 1.38, 0.03);
  EXPECT_NEAR(frame->contact.x_mm, 0.1, 0.1);
  EXPECT_NEAR(frame->contact.y_mm, 0.1, 0.1);
  // The finer map's pixels are at least an eighth of a coarse one beside its middle.
  const int max_um = *std::ranges::max_element(frame->depth_um);
  EXPECT_LE(max_um, 1000 * frame->contact.deepest_mm + 0.5);
  EXPECT_GE(max_um, 970 * frame->contact.deepest_mm);
}

TEST_F(PipelineTest, ASharpenedMapMayStayCoarse) {
  config.reconstruction.sharpen = 1;
  config.reconstruction.decimation = 4;
  start(fakes::scattering_toy_calibration(15));
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(frame->sharpen_steps, 1);
  EXPECT_EQ(frame->decimation, 4);
  EXPECT_EQ(frame->width, 36);
  EXPECT_DOUBLE_EQ(frame->mm_per_px, 0.8);
}

TEST_F(PipelineTest, AutoSharpensAsMuchAsTheBoundAsksFor) {
  config.reconstruction.sharpen = ReconstructionRules::kAutoSharpen;
  config.reconstruction.decimation = 0;
  config.reconstruction.max_error_um = 40;  // the plain LUT counts as 50
  start(fakes::scattering_toy_calibration(15));
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth && f.sharpen_steps == 1; }));
  EXPECT_EQ(frame->decimation, 4);
  EXPECT_NEAR(frame->uncertainty_um, 15, 0.1);
}

TEST_F(PipelineTest, AutoWithoutScatteringIsPlain) {
  config.reconstruction.sharpen = ReconstructionRules::kAutoSharpen;
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(frame->sharpen_steps, 0);
  EXPECT_EQ(frame->decimation, 1);
  EXPECT_EQ(frame->made_decimation, 1);
}

TEST_F(PipelineTest, AutoTakesTheCoarsestMapWithinTheBound) {
  config.reconstruction.decimation = 0;
  config.reconstruction.max_error_um = 1000;
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth && f.decimation == 4; }));
  EXPECT_EQ(frame->width, 36);
  EXPECT_NEAR(frame->uncertainty_um, 50, 1);  // a LUT without a stated uncertainty, no press
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.in_contact; }));
  EXPECT_GT(frame->uncertainty_um, 50);
  EXPECT_NEAR(frame->contact.deepest_mm, 0.95, 0.03);  // as in ACoarserMapHoldsTheSameSurface
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
  pipeline->want({.contact = true, .depth = true, .luma = true});
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_luma; }));
  EXPECT_TRUE(frame->has_depth);
  EXPECT_GT(frame->luma.front(), 90);  // the corner, outside the map; unread it is 0
  EXPECT_GT(frame->luma.back(), 90);
}

TEST_F(PipelineTest, KeepsTheReferenceForAStartInContact) {
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
    return f.has_depth && f.health.has(Health::reference_restored) && f.contact.in_contact;
  }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.06);
  ASSERT_TRUE(until([&] { return !all<ReferenceTaken>().empty(); }));
  EXPECT_TRUE(all<ReferenceTaken>()[0].restored);
  camera.press(0);
  ASSERT_TRUE(until_fresh());
  ASSERT_TRUE(until([&] { return all<ReferenceTaken>().size() == 2; }));
  EXPECT_FALSE(all<ReferenceTaken>()[1].restored);
}

TEST_F(PipelineTest, InContactFirstStartScalesTheCalibrations) {
  camera.press(1);
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) {
    return f.has_depth && f.health.has(Health::reference_stale) && f.contact.in_contact;
  }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.06);
  EXPECT_FALSE(fs::exists(folder / "reference.png"));
}

TEST_F(PipelineTest, RezeroUnderContactIsRefusedUnlessForced) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(ask(Rezero{}).outcome, Outcome::done);
  camera.press(0.5);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.in_contact; }));
  const CommandDone refused = ask(Rezero{});
  EXPECT_EQ(refused.outcome, Outcome::refused_contact);
  EXPECT_EQ(refused.message, "there is contact: lift the object and ask again, or force it");
  EXPECT_EQ(ask(Rezero{.force = true}).outcome, Outcome::done);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) {
    return f.has_depth && !f.contact.in_contact && f.contact.deepest_mm < 0.1;
  }));
}

TEST_F(PipelineTest, HalvedLightReadsTheSameDepthAfterANewReference) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(ask(SetLight{dimmed(128)}).outcome, Outcome::done);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth; }));
  // The calibration is under full light, so that this flag remains.
  EXPECT_TRUE(frame->health.has(Health::light_mismatch));
  EXPECT_FALSE(frame->health.has(Health::reference_stale));
  EXPECT_EQ(frame->light.brightness, 128);
  ASSERT_TRUE(until([&] { return all<ReferenceTaken>().size() == 2; }));
  ASSERT_EQ(all<LightChanged>().size(), 1U);
  EXPECT_EQ(all<LightChanged>()[0].light.brightness, 128);
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.in_contact; }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.1);
}

TEST_F(PipelineTest, HandsOutTheReferenceImage) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  const CommandDone done = ask(CopyReference{});
  EXPECT_EQ(done.outcome, Outcome::done);
  const auto& copy = std::get<CopyReference>(done.command.what).copy;
  ASSERT_NE(copy, nullptr);
  EXPECT_EQ(copy->width, fakes::kToyWidth);
  EXPECT_EQ(copy->height, fakes::kToyHeight);
  EXPECT_EQ(copy->light.brightness, 255);
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
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.in_contact; }));
  EXPECT_EQ(ask(SetLight{dimmed(128)}).outcome, Outcome::done);
  ASSERT_TRUE(until_frame(
      [](const DepthFrame& f) { return f.has_depth && f.health.has(Health::reference_stale); }));
  EXPECT_TRUE(frame->contact.in_contact);
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.12);
  camera.press(0);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) {
    return f.has_depth && !f.health.has(Health::reference_stale) && !f.contact.in_contact;
  }));
}

TEST_F(PipelineTest, ABrokenRingIsAConditionNotTheEnd) {
  ring.broken = true;
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth; }));
  EXPECT_TRUE(frame->health.has(Health::ring_fault));
  const CommandDone failed = ask(SetLight{dimmed(10)});
  EXPECT_EQ(failed.outcome, Outcome::device_error);
  EXPECT_EQ(failed.message, "the fake ring is broken: fix it");
  EXPECT_EQ(pipeline->status().ring_message, "the fake ring is broken: fix it");
}

// Frames averaged before the ring came are no reference for its light, though it was requested.
TEST_F(PipelineTest, ARingThatComesLaterBeginsTheReferenceAnew) {
  ring.away = true;
  camera.light(0.5);  // the room's
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_frame(
      [](const DepthFrame& f) { return f.has_depth && f.health.has(Health::ring_fault); }));
  ASSERT_TRUE(until([&] { return all<ReferenceTaken>().size() == 1; }));
  ring.away = false;
  ASSERT_TRUE(until_fresh());
  ASSERT_TRUE(until([&] { return all<ReferenceTaken>().size() == 2; }));
  EXPECT_TRUE(all<LightChanged>().empty());
  camera.press(1);
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.contact.in_contact; }));
  EXPECT_NEAR(frame->contact.deepest_mm, 1.0, 0.1);
}

TEST_F(PipelineTest, WithoutCalibrationThereIsLuma) {
  start(nullptr);
  pipeline->want({.contact = true, .luma = true});
  ASSERT_TRUE(until_frame([](const DepthFrame& f) { return f.has_luma; }));
  EXPECT_FALSE(frame->has_depth);
  EXPECT_TRUE(frame->health.has(Health::uncalibrated));
  EXPECT_EQ(frame->luma_width, 160);
  EXPECT_EQ(frame->luma.size(), 160U * 120U);
  EXPECT_NEAR(frame->luma[60 * 160 + 80], 150, 1);
  ASSERT_TRUE(until_state(State::uncalibrated));
  EXPECT_EQ(pipeline->status().calibration, nullptr);
  const CommandDone refused = ask(Rezero{});
  EXPECT_EQ(refused.outcome, Outcome::uncalibrated);
  EXPECT_NE(refused.message.find("dtact-calibrate"), std::string::npos);
}

TEST_F(PipelineTest, ACalibrationCanComeLaterAndBeReplaced) {
  start(nullptr);
  ASSERT_TRUE(until_state(State::uncalibrated));
  EXPECT_EQ(use(fakes::toy_calibration()).outcome, Outcome::done);
  ASSERT_TRUE(until_fresh());
  auto second = fakes::toy_calibration();
  second->name = "second";
  EXPECT_EQ(use(second).outcome, Outcome::done);
  ASSERT_TRUE(until_fresh());  // at once: the reference is the sensor's, not the calibration's
  EXPECT_EQ(pipeline->status().calibration->name, "second");
  EXPECT_EQ(all<ReferenceTaken>().size(), 1U);
}

TEST_F(PipelineTest, DepthIsMadeInAnotherWayAgainstTheSameReference) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  const int full = frame->width;
  EXPECT_EQ(reconstruct({.decimation = 4}).outcome, Outcome::done);
  EXPECT_TRUE(until_frame([](const DepthFrame& f) { return f.decimation == 4; }));
  EXPECT_EQ(frame->width, full / 4);
  EXPECT_TRUE(frame->health.empty());
  EXPECT_EQ(pipeline->status().reconstruction.decimation, 4);
  // The same holds for later calibrations.
  EXPECT_EQ(use(fakes::toy_calibration()).outcome, Outcome::done);
  EXPECT_TRUE(until_frame([](const DepthFrame& f) { return f.has_depth; }));
  EXPECT_EQ(frame->decimation, 4);
  const std::string refused = refusal([&] { (void)reconstruct({.decimation = 1, .sharpen = 2}); });
  EXPECT_NE(refused.find("no LUT"), std::string::npos) << refused;
  EXPECT_EQ(pipeline->status().reconstruction.decimation, 4);
  EXPECT_EQ(all<ReferenceTaken>().size(), 1U);
}

TEST_F(PipelineTest, AWayToMakeDepthWaitsForACalibration) {
  start(nullptr);
  ASSERT_TRUE(until_state(State::uncalibrated));
  const CommandDone done = reconstruct({.decimation = 2});
  EXPECT_EQ(done.outcome, Outcome::done);
  EXPECT_GT(done.at.monotonic_ns, 0);
  EXPECT_EQ(use(fakes::toy_calibration()).outcome, Outcome::done);
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(frame->decimation, 2);
}

TEST_F(PipelineTest, ACalibrationOfAnotherModeIsRefused) {
  start(fakes::toy_calibration());
  ASSERT_TRUE(until_fresh());
  auto other = fakes::toy_calibration();
  auto model = std::make_shared<recon::Model>(*other->model);
  model->rectify = recon::make_crop_table(320, 240, 0, 0, 320, 240);
  model->reference_q8.assign(std::size_t{320} * 240, 30000);
  other->model = model;
  const std::string refused = refusal([&] { (void)use(other); });
  EXPECT_NE(refused.find("is for frames of 320x240 pixels"), std::string::npos) << refused;
  ASSERT_TRUE(until_fresh());
  EXPECT_EQ(pipeline->status().calibration->name, "toy");
  pipeline.reset();
  // The same at start is a health flag: luma flows.
  start(other);
  ASSERT_TRUE(until_state(State::uncalibrated));
  EXPECT_TRUE(pipeline->status().health.has(Health::camera_mismatch));
  EXPECT_NE(pipeline->status().storage_message.find("320x240"), std::string::npos);
  ASSERT_EQ(use(fakes::toy_calibration()).outcome, Outcome::done);
  EXPECT_EQ(pipeline->status().storage_message, "");
}

}  // namespace
}  // namespace dtact::pipeline
