#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/guided/cells.hpp"
#include "clients/calibrate/guided/console.hpp"
#include "clients/calibrate/guided/coverage.hpp"
#include "clients/calibrate/guided/preview.hpp"
#include "clients/calibrate/guided/sensor_checks.hpp"
#include "clients/common/guided.pb.h"

namespace dtact::ctl::guided {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::SizeIs;
using testing::StartsWith;

TEST(HalfBlocks, ShowsTwoPixelsACharacter) {
  // Black above white on the left, white above black on the right.
  const image::Grey8 picture{2, 2, {0, 255, 255, 0}};
  EXPECT_THAT(half_blocks(picture, 2), ElementsAre("\x1b[38;5;232m\x1b[48;5;255m\u2580"
                                                   "\x1b[38;5;255m\x1b[48;5;232m\u2580\x1b[0m"));
}

TEST(HalfBlocks, AveragesAndKeepsTheShape) {
  image::Grey8 picture{80, 40, std::vector<std::uint8_t>(3200, 100)};
  for (std::size_t i = 1; i < picture.pixels.size(); i += 2) picture.pixels[i] = 140;
  const auto lines = half_blocks(picture, 20);
  ASSERT_THAT(lines, SizeIs(5)) << "half as high as wide, two pixels a line";
  // Grey 120 is the twelfth of 24: 232 + 11.
  EXPECT_THAT(lines.front(), StartsWith("\x1b[38;5;243m\x1b[48;5;243m\u2580\u2580"))
      << "a colour is set once";
  EXPECT_THAT(half_blocks({1, 2, {7, 7}}, 50), SizeIs(1)) << "no wider than the picture";
}

TEST(Picture, IsDarkWhereTheSurfaceIs) {
  const image::Grey8 reference{3, 1, {150, 150, 150}};
  const image::Grey8 frame{3, 1, {150, 140, 155}};
  EXPECT_THAT(darkening_picture(reference, frame).pixels, ElementsAre(200, 160, 220));
}

TEST(Cells, MeansOverThePartOfTheFrame) {
  // 120 × 100 pixels from (4, 2) on: cells of 12 × 12, ten across and eight down.
  std::vector<std::uint8_t> luma(std::size_t{130} * 130, 10);
  luma[264] = 10 + 144;
  const CellGrid grid({4, 2, 120, 100});
  EXPECT_EQ(grid.cell_px(), 12);
  const CellMeans cells = grid.of(luma, 130);
  ASSERT_THAT(cells, SizeIs(10 * 8));
  EXPECT_EQ(cells[0], 11);
  EXPECT_EQ(cells[1], 10);
  EXPECT_EQ(CellGrid({0, 0, 1200, 960}).cell_px(), 20);
  EXPECT_THROW(CellGrid({0, 0, 200, 95}), std::invalid_argument);
}

// Of 8 and 16 bits; each pixel of the cell in the eighth column and the fourth row counts.
TEST(Cells, AreInRowsOfTheirColumns) {
  std::vector<std::uint8_t> luma(std::size_t{130} * 110, 10);
  std::vector<std::uint16_t> luma_q8(luma.size(), 10 * 256);
  for (const auto& [x, y] : {std::pair{84, 36}, {95, 47}}) {  // its first and its last pixel
    const auto at = static_cast<std::size_t>(130 * (y + 2) + x + 4);
    luma[at] = 10 + 144;
    luma_q8[at] = 256 * 10 + 128 * 144;
  }
  const CellGrid grid({4, 2, 120, 100});
  const CellMeans whole = grid.of(luma, 130);
  const CellMeans half = grid.of(luma_q8, 130);
  ASSERT_THAT(half, SizeIs(10 * 8));
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(whole[i], i == 3 * 10 + 7 ? 12 : 10) << i;
    EXPECT_EQ(half[i], i == 3 * 10 + 7 ? 11 : 10) << i;
  }
}

TEST(Cells, ADimmedLightIsNoContact) {
  const CellMeans reference(100, 150);
  CellMeans now(100, 147);
  now[5] = 137;
  const ContactEvidence evidence = compare(reference, now);
  EXPECT_EQ(evidence.light, 3);
  EXPECT_EQ(evidence.darkest, 10);
  EXPECT_EQ(evidence.brightest, 0);
  EXPECT_EQ(evidence.dark_cells, 1);
}

TEST(Cells, ARealBallsBrightRingIsNoReferenceInContact) {
  namespace fs = std::filesystem;
  if (!fs::exists(DTACT_SHARED_DIR "/data")) GTEST_SKIP() << "no real images beside the repository";
  for (const char* sensor : {"sensor_a", "sensor_b"}) {
    const fs::path folder = fs::path(DTACT_SHARED_DIR) / "data" / sensor;
    const image::Grey8 reference = image::read_png_grey8(folder / "ball_reference.png");
    const image::Grey8 pressed = image::read_png_grey8(folder / "ball.png");
    const CellGrid grid({0, 0, reference.width, reference.height});
    const CellMeans before = grid.of(reference.pixels, reference.width);
    const CellMeans now = grid.of(pressed.pixels, pressed.width);
    const ContactEvidence evidence = compare(before, now);
    EXPECT_GT(evidence.darkest, 30) << sensor;
    EXPECT_FALSE(reference_in_contact(evidence)) << sensor;
    EXPECT_TRUE(reference_in_contact(compare(now, before))) << sensor << " the other way round";
  }
}

TEST(Steady, CountsFromTheFrameThatDiffers) {
  Steadiness steadiness(1.0);
  EXPECT_EQ(steadiness.add({10, 10}), 1);
  EXPECT_EQ(steadiness.add({10, 10.75F}), 2);
  EXPECT_EQ(steadiness.add({10, 11.5F}), 1) << "slow motion adds up";
  EXPECT_EQ(steadiness.broke_at(), 1.5);
  EXPECT_EQ(steadiness.add({10, 11}), 2);
}

TEST(NextDepth, FillsTheWidestGap) {
  EXPECT_NEAR(next_depth_mm({}, 4), 1.2, 1e-9);
  EXPECT_NEAR(next_depth_mm({1.2}, 4), 0.75, 1e-9) << "half-way from the lightest that shows";
  EXPECT_NEAR(next_depth_mm({1.2, 0.75}, 4), 0.525, 1e-9);
  EXPECT_NEAR(next_depth_mm({1.2, 0.75, 0.5}, 4), 0.975, 1e-9);
}

TEST(ContactWidth, OfABall) {
  // A ball of 4 mm 1.5 mm deep cuts the surface in a circle of 3.122 mm radius; the contact's is
  // 3.04 (fit/press_set.cpp).
  EXPECT_NEAR(contact_width_mm(1.5, 4), 6.06, 0.02);
  EXPECT_NEAR(depth_of_width_mm(6.06, 4), 1.5, 0.01);
}

TEST(Covered, IsTheDepthWhereTheLutsCoverageEnds) {
  auto model = std::make_shared<recon::Model>();
  model->lut = {.first_q6 = -2,
                .um = {-9, -4, 0, 30, 70, 1250, 1500},
                .covered_from_q6 = -1,
                .covered_to_q6 = 3};
  calibration::Calibration made;
  made.model = std::move(model);
  EXPECT_DOUBLE_EQ(covered_mm(made), 1.25);
}

// The daemon compares light in the same way.
TEST(Fitness, RecordsWhatTheLedsEmit) {
  v1::LightState light;
  light.set_brightness(128);
  light.add_leds()->set_r(255);
  light.mutable_leds(0)->set_g(100);
  EXPECT_EQ(leds_of(light), (std::vector<std::uint8_t>{128, 50, 0}));
  light.set_gamma(2.2);
  EXPECT_EQ(leds_of(light), (std::vector<std::uint8_t>{56, 22, 0}));
}

TEST(Fitness, NamesWhatKeepsFromCalibrating) {
  v1::Status status;
  status.set_state(v1::STATE_UNCALIBRATED);
  status.add_health(v1::HEALTH_UNCALIBRATED);
  status.add_health(v1::HEALTH_NOT_REALTIME);
  status.add_health(v1::HEALTH_REFERENCE_STALE);
  EXPECT_EQ(unfit(status), "");
  EXPECT_FALSE(passing_trouble(status.health()));
  status.add_health(v1::HEALTH_IMAGE_SATURATED);
  status.set_advice("Much of the picture is white.");
  EXPECT_EQ(unfit(status), "Much of the picture is white.");
  status.Clear();
  status.set_state(v1::STATE_CAMERA_LOST);
  EXPECT_THAT(unfit(status), HasSubstr("camera_lost"));
  for (const v1::Health passing : {v1::HEALTH_STARTING, v1::HEALTH_LIGHT_UNSETTLED,
                                   v1::HEALTH_IMAGE_REPEATED, v1::HEALTH_CAMERA_FAULT}) {
    status.clear_health();
    status.add_health(v1::HEALTH_LIGHT_DRIFTED);
    EXPECT_FALSE(passing_trouble(status.health()));
    status.add_health(passing);
    EXPECT_TRUE(passing_trouble(status.health())) << v1::Health_Name(passing);
  }
  status.clear_health();
  status.add_health(v1::HEALTH_LIGHT_DRIFTED);
  status.add_health(v1::HEALTH_FRAMES_LOST);
  EXPECT_FALSE(passing_trouble(status.health()));
}

TEST(Fault, OfAReferenceImage) {
  const recon::RectifyTable table = recon::make_crop_table(100, 100, 0, 0, 100, 100);
  SteadyFrames still;
  still.frames = {{100, 100, std::vector<std::uint8_t>(10000, 150)}};
  still.cells.assign(64, 150);
  still.noise_levels = 1;
  EXPECT_EQ(fault_of(still, table), "");
  still.noise_levels = 3;
  EXPECT_THAT(fault_of(still, table), HasSubstr("gain"));
  still.noise_levels = 2.5;
  std::fill_n(still.frames[0].pixels.begin(), 200, std::uint8_t{253});
  EXPECT_EQ(fault_of(still, table), "");
  std::fill_n(still.frames[0].pixels.begin(), 100, std::uint8_t{254});
  EXPECT_EQ(fault_of(still, table), "");
  std::fill_n(still.frames[0].pixels.begin(), 200, std::uint8_t{254});
  EXPECT_THAT(fault_of(still, table), HasSubstr("2 % of the picture is white"));
  still.cells.assign(64, 12);
  EXPECT_THAT(fault_of(still, table), HasSubstr("too dark (mean grey 12)"));
}

/// A console that reads a pipe.
class Piped : public testing::Test {
 public:
  Piped() {
    if (::pipe(ends_.data()) != 0) throw std::runtime_error("no pipe");
  }
  ~Piped() override {
    ::close(ends_[0]);
    end_input();
  }

 protected:
  void type(const std::string& text) const {
    ASSERT_EQ(::write(ends_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  void end_input() {
    if (ends_[1] >= 0) ::close(ends_[1]);
    ends_[1] = -1;
  }

  std::array<int, 2> ends_{};
  std::ostringstream out_;
  bool ctrl_c_ = false;
};

TEST_F(Piped, GivesLinesOneByOneAndThenTheEnd) {
  StreamConsole console(ends_[0], out_, false, [this] { return ctrl_c_; });
  EXPECT_EQ(console.typed().kind, Typed::Kind::nothing);
  type("\n r \nq");
  Typed typed = console.typed();
  EXPECT_EQ(typed.kind, Typed::Kind::line);
  EXPECT_EQ(typed.line, "");
  EXPECT_EQ(console.typed().line, "r");
  EXPECT_EQ(console.typed().kind, Typed::Kind::nothing) << "a line that is not complete";
  end_input();
  typed = console.typed();
  EXPECT_EQ(typed.kind, Typed::Kind::line);
  EXPECT_EQ(typed.line, "q");
  EXPECT_EQ(console.typed().kind, Typed::Kind::end);
  ctrl_c_ = true;
  EXPECT_EQ(console.typed().kind, Typed::Kind::interrupted);
}

TEST_F(Piped, ReportsAnotherProgramInJson) {
  JsonConsole console(ends_[0], out_, [] { return false; });
  EXPECT_TRUE(console.interactive());
  console.say("first\nsecond");
  const image::Grey8 picture{16, 12, std::vector<std::uint8_t>(192, 200)};
  Scene scene;
  scene.picture = &picture;
  scene.mm_per_px = 0.05;
  scene.words = "no contact";
  scene.prompt = {"Press", {{"", "take the press"}, kQuit}};
  scene.presses = {{"press-01", 3, 4, 5, 1.25}};
  scene.presses_required = 6;
  console.live(scene);
  std::istringstream lines(out_.str());
  std::string line;
  cli::GuidedLine reported;
  std::getline(lines, line);
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(line, &reported).ok()) << line;
  EXPECT_EQ(reported.text(), "first\nsecond");
  std::getline(lines, line);
  // dtact-web recognises scenes, which may be replaced by newer ones, by how they begin.
  EXPECT_TRUE(line.starts_with(R"({"scene":)")) << line;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(line, &reported).ok()) << line;
  EXPECT_EQ(image::decode_png_grey16(reported.scene().picture_png(), "picture").width, 16);
  EXPECT_EQ(reported.scene().prompt(), "Press");
  ASSERT_EQ(reported.scene().answers_size(), 2);
  EXPECT_EQ(reported.scene().answers(0).key(), "");
  EXPECT_EQ(reported.scene().answers(1).words(), "end the session");
  ASSERT_EQ(reported.scene().presses_size(), 1);
  EXPECT_EQ(reported.scene().presses(0).depth_mm(), 1.25);
  EXPECT_EQ(reported.scene().presses_required(), 6U);
  type("q\n");
  EXPECT_EQ(console.typed().line, "q");
}

TEST_F(Piped, ReportsAWholeSceneInJson) {
  JsonConsole console(ends_[0], out_, [] { return false; });
  Scene scene;
  scene.mm_per_px = 0.0417;
  scene.words = "contact 5.1 mm wide";
  scene.prompt = {"Press", {{"r", "retake press-02"}}};
  scene.presses = {{"press-01", 3, 4, 5, 1.25}, {"press-02", 13.5, 24.25, 15, 0.75}};
  scene.covered_mm = 1.375;
  console.live(scene);
  cli::GuidedLine reported;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(out_.str(), &reported).ok());
  const cli::GuidedScene& shown = reported.scene();
  EXPECT_EQ(shown.picture_png(), "") << "unchanged";
  EXPECT_EQ(shown.mm_per_px(), 0.0417);
  EXPECT_EQ(shown.words(), "contact 5.1 mm wide");
  ASSERT_EQ(shown.answers_size(), 1);
  EXPECT_EQ(shown.answers(0).key(), "r");
  EXPECT_EQ(shown.answers(0).words(), "retake press-02");
  ASSERT_EQ(shown.presses_size(), 2);
  EXPECT_EQ(shown.presses(1).name(), "press-02");
  EXPECT_EQ(shown.presses(1).col(), 13.5);
  EXPECT_EQ(shown.presses(1).row(), 24.25);
  EXPECT_EQ(shown.presses(1).radius_px(), 15);
  EXPECT_EQ(shown.presses(1).depth_mm(), 0.75);
  EXPECT_EQ(shown.covered_mm(), 1.375);
}

TEST_F(Piped, LiveLinesAreForPeople) {
  StreamConsole machine(ends_[0], out_, false, [] { return false; });
  const auto asked = [](const std::string& words) {
    Scene scene;
    scene.words = words;
    scene.prompt.answers = {kQuit};
    return scene;
  };
  machine.live(asked("picture"));
  EXPECT_EQ(out_.str(), "");
  StreamConsole person(ends_[0], out_, true, [] { return false; });
  person.live(asked("picture"));
  EXPECT_THAT(out_.str(), HasSubstr("picture\n[q] end the session > "));
  person.live(asked("other"));
  EXPECT_THAT(out_.str(), HasSubstr("\r\x1b[1A\x1b[J\x1b[?7lother")) << "in place of a line below";
  person.say("done");
  EXPECT_THAT(out_.str(), EndsWith("\r\x1b[1A\x1b[Jdone\n")) << "nothing live stays";
  person.live(asked("picture"));
  type("\n");  // and the terminal's echo has moved the cursor
  person.say("done");
  EXPECT_THAT(out_.str(), EndsWith("\r\x1b[2A\x1b[Jdone\n"));
  EXPECT_EQ(person.typed().kind, Typed::Kind::line);
}

}  // namespace
}  // namespace dtact::ctl::guided
