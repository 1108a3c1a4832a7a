// dtact-calibrate force, on pictures of a drawn ball and on a recording made here.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/calibrate/calibrate.hpp"
#include "clients/calibrate/force/force_pairs.hpp"
#include "clients/recording/channels.hpp"
#include "clients/recording/recording_writer.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/image/png.hpp"
#include "hal/mcap/file_sink.hpp"
#include "tests/unit/calibration/ball.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::force {
namespace {

using calibration::Ball;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

// What a ball of 4 mm presses deeper than 0.1 mm: the cap above that level, and the cylinder of
// 0.1 mm below it.
struct Pressed {
  explicit Pressed(double depth) : h(depth - 0.1) {}
  double h;
  [[nodiscard]] double area() const { return std::numbers::pi * (8 * h - h * h); }
  [[nodiscard]] double volume() const {
    return std::numbers::pi * h * h * (4 - h / 3) + 0.1 * area();
  }
};

class Force : public testing::Test {
 protected:
  Force() {
    write("reference.png", Ball{}.untouched());
    write("ball.png", Ball{}.frame());
    EXPECT_EQ(run({"depth", "--reference", at("reference.png"), "--ball", at("ball.png"),
                   "--radius-mm", "4.0", "--mm-per-px", "0.05", "-o", at("cal")}),
              0)
        << said_;
  }
  [[nodiscard]] std::string at(const std::string& name) const {
    return (temp_.path() / name).string();
  }
  void write(const std::string& name, const image::Grey8& image) const {
    base::write_file_atomically(at(name), image::encode_png(image));
  }
  int run(const std::vector<std::string>& arguments) {
    std::ostringstream out;
    std::ostringstream error;
    const int code = calibrate::run(arguments, out, error);
    said_ = out.str() + error.str();
    return code;
  }
  /// Eight presses of 0.5 to 1.4 mm; the scale shows 0.15 N for each mm³.
  [[nodiscard]] std::string readings(double factor = 1) const {
    std::string csv = "frames,force\n# from light to heavy\n";
    for (const double depth : {0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4}) {
      const std::string name = fmt::format("press{}.png", std::lround(depth * 10));
      write(name, Ball{.depth_mm = depth}.frame());
      csv += fmt::format("{}, {}\n", name, 0.15 * factor * Pressed(depth).volume());
    }
    base::write_file_atomically(at("readings.csv"), csv);
    return at("readings.csv");
  }

  std::string said_;

 private:
  const calibration::TempFolder temp_;
};

TEST_F(Force, SumsUpAPictureAsTheDaemonDoes) {
  const calibration::Calibration cal = calibration::load(at("cal"));
  write("press.png", Ball{.depth_mm = 1.0}.frame());
  const ContactReader reader(cal, cal.model->reference_q8, 0.1);
  const Pair pair = reader.measure(at("press.png"));
  EXPECT_NEAR(pair.volume_mm3, 11.42, 0.4);  // Pressed(1.0), by hand
  EXPECT_NEAR(pair.area_mm2, 20.07, 0.6);
  write("untouched.png", Ball{}.untouched());
  EXPECT_EQ(reader.measure(at("untouched.png")).volume_mm3, 0);
}

TEST_F(Force, IsFittedIntoACalibrationOfItsOwn) {
  ASSERT_EQ(run({"force", "--calibration", at("cal"), "--pairs", readings(), "-o", at("new")}), 0)
      << said_;
  EXPECT_THAT(said_, AllOf(HasSubstr("8 pairs of"), HasSubstr("left out, missed by")));
  EXPECT_FALSE(calibration::load(at("cal")).model->force);
  const auto force = calibration::load(at("new")).model->force;
  ASSERT_TRUE(force);
  EXPECT_EQ(force->threshold_mm, 0.1);
  EXPECT_LT(force->error_n, 0.05);
  const Pressed half_way(1.1);
  EXPECT_NEAR(recon::force_of(*force, half_way.volume(), half_way.area()).newtons,
              0.15 * half_way.volume(), 0.1);
}

TEST_F(Force, IsFittedInPlaceFromGrams) {
  const std::string grams = readings(1 / 0.00980665);
  EXPECT_EQ(run({"force", "--calibration", at("cal"), "--pairs", grams}), 1);
  EXPECT_THAT(said_, HasSubstr("--grams"));
  EXPECT_FALSE(calibration::load(at("cal")).model->force);
  ASSERT_EQ(run({"force", "--calibration", at("cal"), "--pairs", grams, "--grams", "--json"}), 0)
      << said_;
  EXPECT_THAT(said_, HasSubstr("\"error_n\":"));
  EXPECT_TRUE(calibration::load(at("cal")).model->force);
}

/// With a list for sharpened levels that says the same as the plain one, and covers more.
calibration::Calibration sharpenable(calibration::Calibration made) {
  auto model = std::make_shared<recon::Model>(*made.model);
  model->scattering = recon::Scattering{.narrow_mm = 0.3, .wide_mm = 1.5, .narrow_weight = 0.7};
  model->sharpened = {{.steps = 1, .list = model->list, .uncertainty = {}}};
  recon::DepthList& list = model->sharpened.front().list;
  list.covered_to_q6 = list.first_q6 + static_cast<int>(list.um.size()) - 1;
  made.model = std::move(model);
  return made;
}

// Sharpening undoes blur that the drawn ball has not: beside its bright ring, which begins a
// millimetre beyond the contact, the untouched surface darkens.
TEST_F(Force, IsOfMapsSharpenedAsItIsAskedFor) {
  const calibration::Calibration cal = sharpenable(calibration::load(at("cal")));
  calibration::save(cal, at("cal"));
  const std::string csv = readings();
  const Pair plain = ContactReader(cal, cal.model->reference_q8, 0.1).measure(at("press10.png"));
  const Pair sharp = ContactReader(cal, cal.model->reference_q8, 0.1, 1).measure(at("press10.png"));
  EXPECT_GT(std::abs(sharp.volume_mm3 - plain.volume_mm3), 0.02 * plain.volume_mm3);
  EXPECT_GT(sharp.area_mm2, 1.2 * plain.area_mm2);
  ASSERT_EQ(run({"force", "--calibration", at("cal"), "--pairs", csv, "--sharpen", "1"}), 0)
      << said_;
  EXPECT_EQ(calibration::load(at("cal")).model->force->sharpen_steps, 1);
  EXPECT_EQ(run({"force", "--calibration", at("cal"), "--pairs", csv, "--sharpen", "2"}), 1);
  EXPECT_THAT(said_, HasSubstr("--sharpen 2: the calibration has no list"));
}

class ForceOfARecording : public Force {
 protected:
  /// 16 frames, their maps sharpened by so many steps; in those from 4 on something presses (frame
  /// − 3) mm³.
  [[nodiscard]] std::string recording(const std::string& calibration_folder,
                                      std::uint32_t sharpen_steps = 0) const {
    mcap::FileSink sink(at("press.mcap"), true);
    recording::RecordingWriter writer(sink, {.program = "test"});
    for (std::uint64_t i = 0; i < 16; ++i) {
      v1::Frame frame;
      frame.set_sequence(i);
      frame.set_monotonic_ns(static_cast<std::int64_t>(i + 1) * 16'666'667);
      frame.set_wall_ns(frame.monotonic_ns());
      v1::DepthMap& map = *frame.mutable_depth();
      map.set_encoding(v1::DEPTH_INT16);
      map.set_width(1);
      map.set_height(1);
      map.set_mm_per_px(0.05);
      map.set_um_per_unit(1);
      map.set_data(std::string(2, '\0'));
      map.set_sharpen_steps(sharpen_steps);
      v1::Contact& contact = *frame.mutable_contact();
      if (i >= 4) {
        contact.set_touching(true);
        contact.set_volume_mm3(static_cast<double>(i) - 3);
        contact.set_area_mm2(4);
      }
      if (i == 15) frame.add_health(v1::HEALTH_BEYOND_CALIBRATION);
      writer.add(frame);
    }
    for (const char* name : {recording::kCalibrationToml, recording::kReferencePng}) {
      writer.attach(name, "", base::read_file(at(calibration_folder) + "/" + name));
    }
    writer.finish();
    return at("press.mcap");
  }
};

TEST_F(ForceOfARecording, TakesWhatTheDaemonMeasured) {
  const calibration::Calibration cal = calibration::load(at("cal"));
  const ContactReader reader(cal, cal.model->reference_q8, 0.1);
  const std::string file = recording("cal");
  EXPECT_EQ(reader.measure(file + ":10").volume_mm3, 7);
  EXPECT_EQ(reader.measure(file + ":8:11").volume_mm3, 6);  // 5, 6 and 7
  EXPECT_EQ(reader.measure(file + ":2:6").area_mm2, 4);     // of those that touch
  EXPECT_EQ(reader.measure(file + ":0:4").volume_mm3, 0);
  EXPECT_THAT([&] { (void)reader.measure(file); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("press.mcap:15"), HasSubstr("deeper than"))));
  EXPECT_THAT([&] { (void)reader.measure(file + ":x"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("press.mcap:120:180")));
}

TEST_F(ForceOfARecording, RefusesThatOfMapsSharpenedOtherwise) {
  calibration::save(sharpenable(calibration::load(at("cal"))), at("cal"));
  const calibration::Calibration cal = calibration::load(at("cal"));
  const std::string file = recording("cal", 1);
  const ContactReader plain(cal, cal.model->reference_q8, 0.1);
  EXPECT_THAT(
      [&] { (void)plain.measure(file + ":10"); },
      ThrowsMessage<std::runtime_error>(AllOf(
          HasSubstr("press.mcap:10: its depth was made with 1 steps"), HasSubstr("--sharpen"))));
  EXPECT_EQ(ContactReader(cal, cal.model->reference_q8, 0.1, 1).measure(file + ":10").volume_mm3,
            7);
}

TEST_F(ForceOfARecording, RefusesThatOfAnotherCalibration) {
  const std::string file = recording("cal");
  ASSERT_EQ(run({"depth", "--reference", at("reference.png"), "--ball", at("ball.png"),
                 "--radius-mm", "4.0", "--mm-per-px", "0.051", "-o", at("other")}),
            0);
  EXPECT_EQ(run({"force", "--calibration", at("other"), "--pair", file + "@0.5"}), 1);
  EXPECT_THAT(said_, HasSubstr("dtact-calibrate reprocess"));
}

TEST_F(Force, ReadsItsInputStrictly) {
  EXPECT_EQ(parse_reading("a@b/press.png@0.52").frames, "a@b/press.png");
  EXPECT_EQ(parse_reading("press.png@0.52").value, 0.52);
  for (const char* text : {"press.png", "press.png@", "@0.5", "press.png@0.5N"}) {
    EXPECT_THROW((void)parse_reading(text), std::runtime_error) << text;
  }
  base::write_file_atomically(at("a.csv"), "press.png,0.5\n");
  EXPECT_THAT(
      [&] { (void)read_readings(at("a.csv")); },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("a.csv:1"), HasSubstr("frames,force"))));
  base::write_file_atomically(at("b.csv"), "frames,force\n\npress.png,heavy\n");
  EXPECT_THAT([&] { (void)read_readings(at("b.csv")); },
              ThrowsMessage<std::runtime_error>(HasSubstr("b.csv:3")));
}

}  // namespace
}  // namespace dtact::force
