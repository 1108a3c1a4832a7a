// The session against a sensor and a console that the tests play.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "clients/calibrate/guided/capture.hpp"
#include "clients/calibrate/guided/session.hpp"
#include "clients/calibrate/guided/work_folder.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/calibrate/guided_fakes.hpp"
#include "tests/unit/calibrate/predicted_press.hpp"

namespace dtact::ctl::guided {
namespace {

namespace fs = std::filesystem;
using test::FakeConsole;
using test::FakeSensor;
using test::Scene;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

const Scene kContactFree{.frames = 60};

class GuidedSession : public testing::Test {
 public:
  GuidedSession() {
    std::string name = (fs::temp_directory_path() / "dtact_guided_XXXXXX").string();
    plan_.folder = fs::path(::mkdtemp(name.data())) / "ball";
    plan_.ball_radius_mm = 4;
    plan_.map.mm_per_px = 0.05;
    plan_.map.camera_mm = 1000;  // the imagined sensor has parallel rays
    plan_.presses = 4;
    plan_.reference_frames = 8;
    plan_.press_frames = 4;
    plan_.timeout_s = 8;
    // The fits of the other methods take seconds each.
    plan_.method = FitMethod::alone;
    plan_.again = "dtact-calibrate guided --folder X";
  }
  ~GuidedSession() override { fs::remove_all(plan_.folder.parent_path()); }

 protected:
  Outcome run(FakeSensor& sensor, FakeConsole& console) {
    return Session(sensor, console, plan_).run();
  }
  [[nodiscard]] bool has(const std::string& name) const { return fs::exists(plan_.folder / name); }

  Plan plan_;
};

/// No contact, then presses with pauses without contact in between.
std::vector<Scene> presses(const std::vector<Scene>& each) {
  std::vector<Scene> scenes{kContactFree};
  for (const Scene& press : each) {
    scenes.push_back(press);
    scenes.push_back(kContactFree);
  }
  return scenes;
}

const std::vector<Scene> kEnough = presses({{.depth_mm = 1.3},
                                            {.depth_mm = 0.5, .x_px = 130, .y_px = 170},
                                            {.depth_mm = 0.75, .x_px = 180},
                                            {.depth_mm = 1.0, .y_px = 140}});

TEST_F(GuidedSession, GoesFromNothingToAnUpload) {
  FakeSensor sensor(kEnough);
  FakeConsole console({"", "", "", "", "", ""});
  EXPECT_EQ(run(sensor, console), Outcome::uploaded) << console.said;
  EXPECT_EQ(sensor.uploaded.value_or(v1::UploadCalibration{}).name(), "ball");
  EXPECT_THAT(console.said,
              AllOf(HasSubstr("fake 1.0: camera fake:1, 320x300 mjpeg at 60 fps"),
                    HasSubstr("reference taken: 8 frames"),
                    HasSubstr("noise 1.1"),  // of the grain from -1 to 2: the root of 5/4
                    HasSubstr("press-04 taken"),
                    HasSubstr("the daemon uses calibration ball from now on")));
  EXPECT_TRUE(has("preview.png"));
  // The daemon compares itself with these.
  const calibration::Calibration made = calibration::load(plan_.folder / "calibration");
  EXPECT_EQ(made.origin.camera, "fake:1");
  EXPECT_EQ(made.origin.pixel_format, "mjpeg");
  EXPECT_EQ(made.origin.fps, 60);
  ASSERT_EQ(made.origin.controls.size(), 1U);
  EXPECT_EQ(made.origin.controls[0].value, 100);
  EXPECT_EQ(made.origin.leds, std::vector<std::uint8_t>(24, 255));
  // 30 grey levels a millimetre, as well as four presses of noisy frames determine it.
  const recon::DepthLut& lut = made.model->lut;
  for (const double mm : {0.3, 0.6, 0.9, 1.2}) {
    const auto q6 = static_cast<std::size_t>(std::lround(mm * 30 * 64) - lut.first_q6);
    EXPECT_NEAR(lut.um[q6], 1000 * mm, 30) << mm;
  }
}

TEST_F(GuidedSession, TheBatchCommandReadsTheWorkFolder) {
  FakeSensor sensor(kEnough);
  FakeConsole console({"", "", "", "", "", "n"});
  EXPECT_EQ(run(sensor, console), Outcome::kept);
  EXPECT_FALSE(sensor.uploaded.has_value());
  PressImages images = begin_presses({(plan_.folder / "reference").string()}, 4, plan_.map);
  for (const char* name : {"press-01", "press-02", "press-03", "press-04"}) {
    add_press(images, (plan_.folder / name).string());
  }
  calibration::PressReport report;
  const calibration::Calibration batch = build_lut(images, plan_.method, &report);
  const calibration::Calibration guided = calibration::load(plan_.folder / "calibration");
  EXPECT_EQ(batch.model->lut.um, guided.model->lut.um);
  EXPECT_EQ(batch.origin.leds, guided.origin.leds);
}

TEST_F(GuidedSession, AnEndAtTheUploadKeepsTheCalibration) {
  for (const char* end : {"quit", "input"}) {
    plan_.folder = plan_.folder.parent_path() / end;
    std::deque<std::string> lines(5);
    if (end == std::string("quit")) lines.emplace_back("q");
    FakeSensor sensor(kEnough);
    FakeConsole console(lines);
    EXPECT_EQ(run(sensor, console), Outcome::kept) << console.said;
    EXPECT_THAT(console.said, AllOf(HasSubstr("later: dtactctl calibration upload"),
                                    Not(HasSubstr("before there was a calibration"))));
    EXPECT_TRUE(has("calibration"));
    EXPECT_FALSE(sensor.uploaded.has_value());
  }
}

TEST_F(GuidedSession, YesUploads) {
  FakeSensor sensor(kEnough);
  FakeConsole console({"", "", "", "", "", "yes"});
  EXPECT_EQ(run(sensor, console), Outcome::uploaded) << console.said;
}

TEST_F(GuidedSession, ADoubtfulLutIsNotMadeUnlessForced) {
  plan_.map.mm_per_px = 0.005;
  {
    FakeSensor sensor(kEnough);
    FakeConsole console({"", "", "", "", "", "s", "q"});
    EXPECT_EQ(run(sensor, console), Outcome::unfinished) << console.said;
    EXPECT_THAT(console.said, AllOf(HasSubstr("not yet a LUT: a grey level is 0.3 um"),
                                    HasSubstr("that is not yet enough: a grey level is"),
                                    HasSubstr("--force takes it as it is")));
    EXPECT_FALSE(has("calibration"));
  }
  plan_.force = true;
  FakeSensor sensor(presses({}));
  FakeConsole console({"", "n"});
  EXPECT_EQ(run(sensor, console), Outcome::kept) << console.said;
  EXPECT_THAT(console.said, HasSubstr("doubtful: a grey level is 0.3 um"));
  EXPECT_TRUE(has("calibration"));
}

TEST_F(GuidedSession, GoesOnAfterQuit) {
  {
    FakeSensor sensor(kEnough);
    FakeConsole console({"", "", "", "q"});
    EXPECT_EQ(run(sensor, console), Outcome::unfinished);
    EXPECT_THAT(console.said, HasSubstr("To continue: dtact-calibrate guided --folder X"));
  }
  EXPECT_TRUE(has("reference/sensor.toml"));
  EXPECT_TRUE(has("press-02/03.png"));
  EXPECT_FALSE(has("press-03"));
  FakeSensor sensor(presses({{.depth_mm = 0.75, .x_px = 180}, {.depth_mm = 1.0}}));
  FakeConsole console({"", "", "", ""});
  EXPECT_EQ(run(sensor, console), Outcome::uploaded) << console.said;
  EXPECT_THAT(console.said, AllOf(HasSubstr("2 press(es) are there"), Not(HasSubstr("Step 1"))));
}

TEST_F(GuidedSession, InputThatEndsLosesNothing) {
  FakeSensor sensor(kEnough);
  FakeConsole console({"", ""});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_THAT(console.said, HasSubstr("The input ended"));
  EXPECT_TRUE(has("press-01/00.png"));
}

TEST_F(GuidedSession, CtrlCLosesNothing) {
  FakeSensor sensor(kEnough);
  FakeConsole console({"", ""});
  sensor.on_status = [&](v1::Status&) { console.ctrl_c = fs::exists(plan_.folder / "press-01"); };
  FakeConsole* seen = &console;
  EXPECT_EQ(run(sensor, *seen), Outcome::unfinished);
  EXPECT_TRUE(has("reference/00.png"));
}

TEST_F(GuidedSession, ADaemonThatGoesSaysHowToGoOn) {
  FakeSensor sensor(kEnough);
  sensor.frames_until_gone = 100;
  FakeConsole console({"", "", "", ""});
  EXPECT_THROW((void)run(sensor, console), client::ConnectionError);
  EXPECT_THAT(console.said, HasSubstr("To continue: dtact-calibrate guided --folder X"));
  EXPECT_TRUE(has("press-01/00.png"));
}

TEST_F(GuidedSession, RetakesTheLastPress) {
  FakeSensor sensor(kEnough);
  FakeConsole console({"", "", "", "r", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_TRUE(has("press-02"));
  EXPECT_FALSE(has("press-03"));
  EXPECT_THAT(console.said, HasSubstr("[r] retake press-02"));
  // The third press is where the second was: at column 180.
  EXPECT_THAT(console.said, HasSubstr("press-02 taken: a contact"));
  const std::size_t last = console.said.rfind("press-02 taken");
  EXPECT_THAT(console.said.substr(last, 80), HasSubstr("column 180, row 150"));
}

TEST_F(GuidedSession, APressThatStaysIsNotTakenTwice) {
  FakeSensor sensor({kContactFree, {.depth_mm = 1.3}});
  FakeConsole console({"", "", ""});
  EXPECT_THAT([&] { (void)run(sensor, console); },
              ThrowsMessage<CaptureTimeout>(HasSubstr("this press is taken already")));
  EXPECT_TRUE(has("press-01"));
  EXPECT_FALSE(has("press-02"));
}

TEST_F(GuidedSession, WaitsForAPressToHoldStill) {
  // Half a millimetre a second, to 1.3 mm; then it rests.
  FakeSensor sensor(
      {kContactFree, {.depth_mm = 0, .frames = 156, .step_mm = 0.5 / 60}, {.depth_mm = 1.3}});
  FakeConsole console({"", "", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  // 0.3 mm of the ball's radius below the darkening of 3 grey levels: 1.3 mm were pressed.
  EXPECT_THAT(console.said, HasSubstr("darkest 39 grey levels"));
}

// 0.35 levels a second: within the 1.5 that a picture may move while it is taken, but its second
// half is 0.5 darker than its first.
TEST(Capture, WhatCreepsIsNoStillPicture) {
  FakeSensor sensor({{.depth_mm = 1, .frames = 1000, .step_mm = 0.0117 / 30}});
  FakeConsole console({});
  const CellGrid grid({100, 90, 120, 120});
  Capture capture(sensor, console, grid, {.timeout_s = 2},
                  [](const ObservedFrame&, const std::string&) {});
  EXPECT_THROW((void)capture.reference(90), CaptureTimeout);
}

// There was contact at the first reference, and the camera is set to another exposure before the
// second. Before: the press stayed, and was compared with a reference of another brightness.
TEST_F(GuidedSession, AReferenceThatIsRetakenIsOfTheSameSettings) {
  FakeSensor sensor({{.depth_mm = 0.4, .x_px = 130, .y_px = 110, .frames = 40},
                     {.depth_mm = 1.3, .x_px = 190, .y_px = 180},
                     kContactFree});
  FakeConsole console({"", "", "", ""});
  sensor.on_status = [&](v1::Status& now) {
    if (console.said.find("has to be taken again") != std::string::npos)
      now.mutable_camera()->mutable_controls(0)->set_value(50);
  };
  EXPECT_THAT([&] { (void)run(sensor, console); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("the sensor changed: "), HasSubstr("begin again in another"))));
  EXPECT_THAT(console.said, HasSubstr("press-01 taken"));
  EXPECT_EQ(recorded_origin({(plan_.folder / "reference").string()}).controls.at(0).value, 100);
}

TEST_F(GuidedSession, APersonMayTakeWhatDoesNotHoldStill) {
  FakeSensor sensor({kContactFree, {.depth_mm = 0.5, .frames = 1000, .step_mm = 0.001}});
  FakeConsole console({"", "~25", "", "~3", "", "~50", "q"});
  console.person = true;
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_THAT(console.said, HasSubstr("press-01 taken"));
}

// 1.2 mm a second: it holds still for three frames at most.
TEST_F(GuidedSession, OnlyEnterTakesWhatDoesNotHoldStill) {
  FakeSensor sensor({kContactFree, {.depth_mm = 0.5, .frames = 1000, .step_mm = 0.02}});
  FakeConsole console({"", "~25", "", "~3", "s", "~50", "q"});
  console.person = true;
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_THAT(console.said,
              AllOf(HasSubstr("\"s\" means nothing here"), Not(HasSubstr("press-01 taken"))));
}

// Enter before the contact: that was not meant for the press that follows.
TEST_F(GuidedSession, AnEarlyEnterDoesNotTakeAMovingPress) {
  FakeSensor sensor({kContactFree, {.depth_mm = 0.5, .frames = 1000, .step_mm = 0.02}});
  FakeConsole console({"", "", "", "~60", "q"});
  console.person = true;
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_THAT(console.said, Not(HasSubstr("press-01 taken")));
}

// Its contact leaves the map.
TEST_F(GuidedSession, ARefusedPressIsNotTakenAlready) {
  FakeSensor sensor({kContactFree, {.depth_mm = 1.3, .x_px = 20}});
  FakeConsole console({"", "", "", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished) << console.said;
  const std::string refused = "not taken: the contact";
  EXPECT_THAT(console.said, AllOf(HasSubstr(refused), Not(HasSubstr("taken already"))));
  EXPECT_NE(console.said.find(refused), console.said.rfind(refused)) << console.said;
}

// Before: it was taken, and left out of the LUT at the end.
TEST_F(GuidedSession, APressThatIsBlackIsRefused) {
  FakeSensor sensor({kContactFree, {.depth_mm = 1.0}});
  sensor.paint = [](const Scene& scene) {
    v1::LumaMap map = test::picture(scene, scene.depth_mm, 1);
    for (char& pixel : *map.mutable_data()) {
      if (static_cast<unsigned char>(pixel) < 190) pixel = 0;
    }
    return map;
  };
  FakeConsole console({"", "", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished) << console.said;
  EXPECT_THAT(console.said, HasSubstr("not taken: the ball's image is black at the contact"));
}

TEST_F(GuidedSession, ATooLightPressIsRefusedAndNotKept) {
  FakeSensor sensor(presses({{.depth_mm = 0.22}}));
  FakeConsole console({"", "", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_THAT(console.said, HasSubstr("not taken: no contact found"));
  EXPECT_FALSE(has("press-01"));
}

TEST_F(GuidedSession, NamesThePressThatIsMissing) {
  FakeSensor sensor(presses({{.depth_mm = 1.5}, {.depth_mm = 1.4, .x_px = 130}}));
  FakeConsole console({"", "", "", "s", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_THAT(console.said,
              AllOf(HasSubstr("that is not yet enough: no press shows indentations from 0.00 to"),
                    HasSubstr("Press 3 of 4: the one that is missing")));
}

/// A ball of 4 mm pressed into a gel at the scene's position; `depth_mm` is the contact's radius.
v1::LumaMap gel_picture(const Scene& scene) {
  static std::map<double, v1::LumaMap> painted;  // a picture takes a while
  v1::LumaMap& map = painted[scene.depth_mm];
  if (map.width() > 0) return map;
  calibration::ImaginedView view;
  view.width = test::kWidth;
  view.height = test::kHeight;
  view.col = scene.x_px;
  view.row = scene.y_px;
  view.contact_radius_mm = scene.depth_mm;
  map.set_encoding(v1::LUMA_GREY8);
  map.set_width(test::kWidth);
  map.set_height(test::kHeight);
  if (scene.depth_mm == 0) {
    map.mutable_data()->assign(std::size_t{test::kWidth} * test::kHeight, static_cast<char>(160));
  } else {
    const image::Grey8 frame = view.frame();
    map.mutable_data()->assign(frame.pixels.begin(), frame.pixels.end());
  }
  return map;
}

// Contacts of 2.8 and 2.5 mm are 1.1 and 0.9 mm deep: a chain of them cannot begin at zero.
TEST_F(GuidedSession, EndsWhereTheGelMakesUpForAPress) {
  plan_.map.mm_per_px = calibration::ImaginedView::kMmPerPx;
  plan_.presses = 6;
  plan_.method = FitMethod::automatic;
  FakeSensor sensor(presses({{.depth_mm = 2.8}, {.depth_mm = 2.5, .x_px = 150, .y_px = 158}}));
  sensor.paint = gel_picture;
  FakeConsole console({"", "", "", "s", ""});
  EXPECT_EQ(run(sensor, console), Outcome::uploaded) << console.said;
  EXPECT_THAT(console.said, AllOf(HasSubstr("not yet a LUT: no press shows indentations from"),
                                  HasSubstr("of a gel")));
}

TEST_F(GuidedSession, AReferenceUnderTouchIsTakenAgain) {
  FakeSensor sensor({{.depth_mm = 1.0, .frames = 30}, kContactFree, {.depth_mm = 0.9}});
  FakeConsole console({"", "", "", "", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_THAT(console.said, AllOf(HasSubstr("there was contact when that was taken"),
                                  HasSubstr("press-01 taken"), HasSubstr("darkest 27 grey")));
}

TEST_F(GuidedSession, RefusesAnUnfitDaemon) {
  FakeSensor sensor(kEnough);
  sensor.now.set_state(v1::STATE_CAMERA_LOST);
  sensor.now.add_health(v1::HEALTH_CAMERA_FAULT);
  sensor.now.set_advice("The camera gives no frames. Plug it in.");
  FakeConsole console({""});
  EXPECT_THAT([&] { (void)run(sensor, console); },
              ThrowsMessage<std::runtime_error>(HasSubstr("Plug it in")));
}

TEST_F(GuidedSession, WaitsForACameraThatStumbles) {
  FakeSensor sensor(kEnough);
  int asked = 0;
  sensor.on_status = [&](v1::Status& now) {
    now.clear_health();
    if (++asked % 6 != 0) now.add_health(v1::HEALTH_CAMERA_FAULT);
  };
  FakeConsole console({"", "", "", "", "", "", "", ""});
  EXPECT_EQ(run(sensor, console), Outcome::uploaded) << console.said;
}

TEST_F(GuidedSession, SaysWhyNothingComes) {
  FakeSensor sensor(kEnough);
  sensor.silent = true;
  sensor.now.set_advice("Look at the cable.");
  FakeConsole console({""});
  EXPECT_THAT([&] { (void)run(sensor, console); },
              ThrowsMessage<CaptureTimeout>(HasSubstr("Look at the cable.")));
}

/// No contact, with a passing health flag in the first `flagged` frames.
class FlaggedSensor : public FakeSensor {
 public:
  explicit FlaggedSensor(std::uint32_t flagged) : FakeSensor({kContactFree}) {
    now.add_health(v1::HEALTH_LIGHT_UNSETTLED);
    paint = [this, flagged](const Scene& scene) {
      if (++frames_ == flagged) now.clear_health();
      return test::picture(scene, scene.depth_mm, frames_);
    };
  }

 private:
  std::uint32_t frames_ = 0;
};

// 90 frames are 1.5 s at any rate: neither the message's two seconds nor the limit's eight.
TEST_F(GuidedSession, UnusableFramesCountByTheirTimes) {
  FlaggedSensor sensor(90);
  FakeConsole console({"", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished) << console.said;
  EXPECT_THAT(console.said,
              AllOf(HasSubstr("reference taken"), Not(HasSubstr("no usable frame came"))));
}

TEST_F(GuidedSession, SaysOnceThatNoFrameIsUsable) {
  FlaggedSensor sensor(270);  // 4.5 s
  FakeConsole console({"", "q"});
  EXPECT_EQ(run(sensor, console), Outcome::unfinished) << console.said;
  const std::string message = "no usable frame came";
  EXPECT_THAT(console.said, AllOf(HasSubstr("reference taken"), HasSubstr(message)));
  EXPECT_EQ(console.said.find(message), console.said.rfind(message)) << console.said;
}

// The daemon would refuse the calibration: 6 of its 40 columns and of its 30 rows lie within.
TEST_F(GuidedSession, RefusesATooSmallCropBeforeTheFirstImage) {
  FakeSensor sensor(kEnough);
  sensor.now.mutable_camera()->set_width(640);
  sensor.now.mutable_camera()->set_height(480);
  plan_.map.crop = {120, 120};
  FakeConsole console({});
  EXPECT_THAT([&] { (void)run(sensor, console); },
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("\"ball\" covers 120x120"), HasSubstr("three tenths"))));
  EXPECT_THAT(console.said, Not(HasSubstr("Step 1")));
}

TEST_F(GuidedSession, AnotherLightIsRefused) {
  {
    FakeSensor sensor(kEnough);
    FakeConsole console({"", "", "q"});
    EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  }
  FakeSensor sensor(kEnough);
  sensor.now.mutable_light()->set_brightness(128);
  FakeConsole console({"", ""});
  EXPECT_THAT([&] { (void)run(sensor, console); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("LED 0 shows 128 128 128 but showed 255 255 255"),
                        HasSubstr("dtactctl led"), HasSubstr("another --folder"))));
  sensor.now.mutable_light()->set_brightness(255);
  sensor.now.mutable_camera()->mutable_controls(0)->set_value(50);
  EXPECT_THAT(
      [&] { (void)run(sensor, console); },
      ThrowsMessage<std::runtime_error>(HasSubstr("the control exposure is 50 but was 100")));
}

TEST_F(GuidedSession, AnotherBallIsRefused) {
  {
    FakeSensor sensor(kEnough);
    FakeConsole console({"", "", "q"});
    EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  }
  plan_.ball_radius_mm = 5;
  FakeSensor sensor(kEnough);
  FakeConsole console({"", ""});
  EXPECT_THAT([&] { (void)run(sensor, console); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("of a ball of 4 mm radius, not 5 mm"), HasSubstr("--radius-mm 4"),
                        HasSubstr("another --folder"))));
}

TEST_F(GuidedSession, TheHundredAndFirstPressTakesNobodysPlace) {
  for (const char* name : {"press-99", "press-100"}) fs::create_directories(plan_.folder / name);
  EXPECT_EQ(WorkFolder(plan_.folder).next_press(), "press-101");
}

TEST_F(GuidedSession, TheFoldersNameSuitsTheDaemon) {
  EXPECT_EQ(WorkFolder(plan_.folder / "left hand.2/").calibration_name(), "left-hand-2");
}

TEST_F(GuidedSession, DrawsForAPerson) {
  FakeSensor sensor(kEnough);
  FakeConsole console({"~30", "", "~25", "p", "~30", "q"});
  console.person = true;
  EXPECT_EQ(run(sensor, console), Outcome::unfinished);
  EXPECT_THAT(console.said, HasSubstr("preview.png"));
  EXPECT_TRUE(console.drew);
  EXPECT_THAT(text_of(console.drawn.prompt), HasSubstr("[q] end the session"));
  EXPECT_EQ(console.drawn.presses_required, plan_.presses);
}

/// Calls `on_line` before the session reads a line.
class WatchedConsole : public FakeConsole {
 public:
  using FakeConsole::FakeConsole;
  [[nodiscard]] Typed typed() override {
    Typed typed = FakeConsole::typed();
    if (typed.kind == Typed::Kind::line && on_line) on_line(typed.line);
    return typed;
  }
  std::function<void(const std::string& line)> on_line;
};

// As long as there is no press, nothing depends on the light of the reference before.
TEST_F(GuidedSession, AReferenceWithoutPressesIsRetakenUnderAnotherLight) {
  FakeSensor sensor({kContactFree});
  WatchedConsole console({"", "r", "", "q"});
  console.on_line = [&](const std::string& line) {
    if (line == "r") sensor.now.mutable_light()->set_brightness(128);
  };
  EXPECT_EQ(run(sensor, console), Outcome::unfinished) << console.said;
  EXPECT_THAT(console.said, HasSubstr("[r] retake reference"));
  const std::string taken = "reference taken: 8 frames";
  EXPECT_NE(console.said.find(taken), console.said.rfind(taken)) << console.said;
  EXPECT_EQ(recorded_origin({(plan_.folder / "reference").string()}).leds,
            std::vector<std::uint8_t>(24, 128));
}

// There was contact at the first reference, and the light changes before the second.
TEST_F(GuidedSession, AReferenceThatIsRetakenIsOfTheSameLight) {
  FakeSensor sensor({{.depth_mm = 0.4, .x_px = 130, .y_px = 110, .frames = 40},
                     {.depth_mm = 1.3, .x_px = 190, .y_px = 180},
                     kContactFree});
  WatchedConsole console({"", "", "", ""});
  console.on_line = [&](const std::string&) {
    if (console.said.find("has to be taken again") != std::string::npos)
      sensor.now.mutable_light()->set_brightness(128);
  };
  EXPECT_THAT([&] { (void)run(sensor, console); },
              ThrowsMessage<std::runtime_error>(
                  HasSubstr("the light is another than when the reference was taken")));
  EXPECT_EQ(recorded_origin({(plan_.folder / "reference").string()}).leds,
            std::vector<std::uint8_t>(24, 255));
}

// 0.1 mm deep, where 3 grey levels end the contact, a ball 1.3 mm deep is 2.86 mm in radius.
TEST_F(GuidedSession, ShowsThePressesAndWhatTheyCover) {
  FakeSensor sensor(kEnough);
  FakeConsole console({"", "", "", "", "", "n"});
  EXPECT_EQ(run(sensor, console), Outcome::kept) << console.said;
  const std::vector<CapturedPress>& shown = console.drawn.presses;
  ASSERT_EQ(shown.size(), 4U);
  const std::vector<CapturedPress> expected{{"press-01", 160, 150, 57, 1.3},
                                            {"press-02", 130, 170, 35, 0.5},
                                            {"press-03", 180, 150, 44, 0.75},
                                            {"press-04", 160, 140, 50, 1.0}};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_THAT(shown[i].name, testing::EndsWith(expected[i].name));
    EXPECT_NEAR(shown[i].col, expected[i].col, 1) << i;
    EXPECT_NEAR(shown[i].row, expected[i].row, 1) << i;
    EXPECT_NEAR(shown[i].radius_px, expected[i].radius_px, 2) << i;
    EXPECT_NEAR(shown[i].depth_mm, expected[i].depth_mm, 0.03) << i;
  }
  EXPECT_NEAR(console.drawn.covered_mm, 1.37, 0.05) << "the deepest press and two grey levels";
  EXPECT_EQ(console.drawn.mm_per_px, 0.05);
}

// Cells of 0.6 mm: about 56 of them are darker by 3 levels, a disc 5.1 mm wide.
TEST_F(GuidedSession, SaysHowWideAndDarkTheContactIs) {
  FakeSensor sensor({kContactFree, {.depth_mm = 1.0}});
  FakeConsole console({"", "~120", "q"});
  console.person = true;
  EXPECT_EQ(run(sensor, console), Outcome::unfinished) << console.said;
  double width_mm = 0;
  double levels = 0;
  ASSERT_EQ(std::sscanf(console.drawn.words.c_str(),
                        "contact %lf mm wide, darkest %lf grey levels; live", &width_mm, &levels),
            2)
      << console.drawn.words;
  EXPECT_NEAR(width_mm, 5.1, 0.3);
  EXPECT_NEAR(levels, 30, 1);
}

}  // namespace
}  // namespace dtact::ctl::guided
