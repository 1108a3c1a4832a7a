// dtact-calibrate force, on pictures of a drawn ball and on a recording made here.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
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
#include "hal/files/mcap_file_sink.hpp"
#include "hal/files/png.hpp"
#include "tests/unit/calibration/ball.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::force {
namespace {

using calibration::Ball;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

class Force : public testing::Test {
 protected:
  Force() {
    write("reference.png", Ball{}.reference_image());
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
  /// Eight presses of 0.5 to 1.4 mm; the scale shows the force of a gel of 2 mm and 0.15 MPa.
  [[nodiscard]] std::string readings(double factor = 1) const {
    const calibration::Calibration cal = calibration::load(at("cal"));
    const ContactReader reader(cal, cal.model->reference_q8, at("cal"));
    std::string csv = "frames,force\n# from light to heavy\n";
    for (const double depth : {0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4}) {
      const std::string name = fmt::format("press{}.png", std::lround(depth * 10));
      write(name, Ball{.depth_mm = depth}.frame());
      const Pair pair = reader.measure(at(name));
      const auto answer = recon::GelResponse(2, pair.contact).answer(pair.contact);
      csv += fmt::format("{}, {}\n", name, 0.15 * factor * answer.mm2);
    }
    base::write_file_atomically(at("readings.csv"), csv);
    return at("readings.csv");
  }

  std::string said_;

 private:
  const calibration::TempFolder temp_;
};

double volume_mm3(const recon::CellMap& cells) {
  double sum = 0;
  for (const float mm : cells.mm()) {
    if (mm > 0) sum += static_cast<double>(mm);
  }
  return sum * cells.cell_mm() * cells.cell_mm();
}

TEST_F(Force, ReadsAPictureAsTheDaemonDoes) {
  const calibration::Calibration cal = calibration::load(at("cal"));
  write("press.png", Ball{.depth_mm = 1.0}.frame());
  const ContactReader reader(cal, cal.model->reference_q8, at("cal"));
  // The cap of 1 mm: π h² (R − h / 3).
  EXPECT_NEAR(volume_mm3(reader.measure(at("press.png")).contact), 11.5, 0.6);
  write("current_reference.png", Ball{}.reference_image());
  EXPECT_NEAR(volume_mm3(reader.measure(at("current_reference.png")).contact), 0, 0.1);
}

// Only the end of a name makes it a recording.
TEST_F(Force, ReadsAPictureBelowAFolderThatIsNamedLikeARecording) {
  const calibration::Calibration cal = calibration::load(at("cal"));
  const ContactReader reader(cal, cal.model->reference_q8, at("cal"));
  for (const char* folder : {"press.mcap", "press.mcap.pictures"}) {
    std::filesystem::create_directory(at(folder));
    const std::string name = std::string(folder) + "/press.png";
    write(name, Ball{.depth_mm = 1.0}.frame());
    EXPECT_NEAR(volume_mm3(reader.measure(at(name)).contact), 11.5, 0.6) << name;
    EXPECT_NEAR(volume_mm3(reader.measure(at(folder)).contact), 11.5, 0.6) << folder;
  }
}

TEST_F(Force, IsFittedIntoACalibrationOfItsOwn) {
  ASSERT_EQ(run({"force", "--calibration", at("cal"), "--pairs", readings(), "--thickness-mm", "2",
                 "-o", at("new")}),
            0)
      << said_;
  EXPECT_THAT(said_, AllOf(HasSubstr("8 pairs of"), HasSubstr("left out, missed by"),
                           HasSubstr("0.150 MPa of a gel 2.00 mm thick")));
  EXPECT_FALSE(calibration::load(at("cal")).model->force);
  const auto force = calibration::load(at("new")).model->force;
  ASSERT_TRUE(force);
  EXPECT_NEAR(force->modulus_mpa, 0.15, 0.002);
  EXPECT_NEAR(force->zero_mm, 0, 0.005);
}

// The daemon would refuse it.
TEST_F(Force, TheCalibrationStaysWhereItsGelIsTooThick) {
  calibration::Calibration thick = calibration::load(at("cal"));
  thick.gel.emplace();
  thick.gel->thickness_mm.value = 7;
  thick.gel->indentation = {0, 0.1, 0.2, 0.3, 0.4};
  calibration::save(thick, at("cal"));
  EXPECT_EQ(run({"force", "--calibration", at("cal"), "--pairs", readings()}), 1);
  EXPECT_THAT(said_, HasSubstr("its gel is 7.00 mm thick; force is calibrated for 0.5 to 5 mm"));
  EXPECT_FALSE(calibration::load(at("cal")).model->force);
}

TEST_F(Force, IsFittedInPlaceFromGrams) {
  const std::string grams = readings(1 / 0.00980665);
  EXPECT_EQ(run({"force", "--calibration", at("cal"), "--pairs", grams}), 1);
  EXPECT_THAT(said_, HasSubstr("--grams"));
  EXPECT_FALSE(calibration::load(at("cal")).model->force);
  ASSERT_EQ(run({"force", "--calibration", at("cal"), "--pairs", grams, "--grams", "--json"}), 0)
      << said_;
  EXPECT_THAT(said_, HasSubstr("\"modulus_mpa\":"));
  EXPECT_TRUE(calibration::load(at("cal")).model->force);
}

class ForceOfARecording : public Force {
 protected:
  /// 16 frames of 40 × 30 pixels; in those from 4 on all but the border is pressed (frame − 3) ·
  /// 0.1 mm deep, and in the last beyond the calibration.
  [[nodiscard]] std::string recording(const std::string& calibration_folder) const {
    mcap::FileSink sink(at("press.mcap"), true);
    recording::RecordingWriter writer(sink, {.program = "test"});
    for (std::uint64_t i = 0; i < 16; ++i) {
      v1::Frame frame;
      frame.set_sequence(i);
      frame.set_monotonic_ns(static_cast<std::int64_t>(i + 1) * 16'666'667);
      frame.set_wall_ns(frame.monotonic_ns());
      v1::DepthMap& map = *frame.mutable_depth();
      map.set_encoding(v1::DEPTH_INT16);
      map.set_width(40);
      map.set_height(30);
      map.set_full_width(40);
      map.set_full_height(30);
      map.set_mm_per_px(0.65);
      map.set_um_per_unit(1);
      std::string bytes;
      for (int y = 0; y < 30; ++y) {
        for (int x = 0; x < 40; ++x) {
          const bool inside = i >= 4 && y > 0 && x > 0 && y < 29 && x < 39;
          const auto um = static_cast<std::uint16_t>(inside ? 100 * (i - 3) : 0);
          bytes += static_cast<char>(um & 0xFFU);
          bytes += static_cast<char>(um >> 8U);
        }
      }
      map.set_data(bytes);
      frame.mutable_contact()->set_in_contact(i >= 4);
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
  const ContactReader reader(cal, cal.model->reference_q8, at("cal"));
  const std::string file = recording("cal");
  const auto deepest = [&](const std::string& frames) {
    return std::ranges::max(reader.measure(file + frames).contact.mm());
  };
  EXPECT_FLOAT_EQ(deepest(":10"), 0.7F);
  EXPECT_FLOAT_EQ(deepest(":8:11"), 0.6F);  // 0.5, 0.6 and 0.7
  EXPECT_FLOAT_EQ(deepest(":2:6"), 0.15F);  // of those in contact
  EXPECT_THAT([&] { (void)reader.measure(file + ":0:4"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no contact")));
  EXPECT_THAT([&] { (void)reader.measure(file); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("press.mcap:15"), HasSubstr("deeper than"))));
  EXPECT_THAT([&] { (void)reader.measure(file + ":x"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("press.mcap:120:180")));
}

// The end is behind the last frame, so a range of one frame has an end that is one more.
TEST_F(ForceOfARecording, TakesARangeOfAtLeastOneFrame) {
  const calibration::Calibration cal = calibration::load(at("cal"));
  const ContactReader reader(cal, cal.model->reference_q8, at("cal"));
  const std::string file = recording("cal");
  EXPECT_FLOAT_EQ(std::ranges::max(reader.measure(file + ":9:10").contact.mm()), 0.6F);
  EXPECT_FLOAT_EQ(std::ranges::max(reader.measure(file + ":13:15").contact.mm()), 1.05F);
  EXPECT_EQ(reader.measure(file + ":9:10").name, file + ":9:10");
  for (const char* range : {":9:9", ":9:8", ":9:", ":", "::9", ":9:x", ":9:10:11", ":-1"}) {
    EXPECT_THAT([&] { (void)reader.measure(file + range); },
                ThrowsMessage<std::runtime_error>(HasSubstr("press.mcap:120:180")))
        << range;
  }
}

TEST_F(ForceOfARecording, RefusesThatOfAnotherCalibration) {
  const std::string file = recording("cal");
  ASSERT_EQ(run({"depth", "--reference", at("reference.png"), "--ball", at("ball.png"),
                 "--radius-mm", "4.0", "--mm-per-px", "0.051", "-o", at("other")}),
            0);
  EXPECT_EQ(run({"force", "--calibration", at("other"), "--pair", file + "@0.5"}), 1);
  // The command can be copied from the message.
  EXPECT_THAT(said_, HasSubstr("dtact-calibrate reprocess " + file + " --calibration " +
                               at("other") + " -o " + at("press-anew.mcap") + " "));
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
  // A spreadsheet's UTF-8 begins with a byte order mark.
  base::write_file_atomically(at("c.csv"),
                              "\xEF\xBB\xBF"
                              "frames,force\r\npress.png,23\r\n");
  ASSERT_EQ(read_readings(at("c.csv")).size(), 1U);
  EXPECT_EQ(read_readings(at("c.csv")).front().value, 23);
}

}  // namespace
}  // namespace dtact::force
