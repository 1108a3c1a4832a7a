// dtact-calibrate reprocess on a recording as dtactctl writes it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "clients/calibrate/calibrate.hpp"
#include "clients/cpp/maps.hpp"
#include "clients/recording/channels.hpp"
#include "clients/recording/read_recording.hpp"
#include "clients/recording/recording_writer.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/mcap_file_sink.hpp"
#include "hal/files/png.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/fakes/toy_sensor.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::reprocess {
namespace {

using testing::Each;
using testing::SizeIs;

/// The ring has grown darker by this share since the reference was taken, and the daemon follows.
constexpr double kFollowed = -0.015;

class Reprocess : public testing::Test {
 protected:
  Reprocess() { calibration::save(*fakes::toy_calibration(), at("cal")); }

  [[nodiscard]] std::string at(const std::string& name) const {
    return (temp_.path() / name).string();
  }

  /// Frames of the undeformed toy. Status and files follow the first one, as in dtactctl record.
  void record(const std::string& name) const {
    mcap::FileSink sink(at(name), true);
    recording::RecordingWriter writer(sink, {.program = "test"});
    const auto jpeg = fakes::make_jpeg(
        {.width = fakes::kToyWidth, .height = fakes::kToyHeight, .colour = false},
        [](int x, int y) {
          return static_cast<int>(std::lround(fakes::toy_grey({.light = 1 + kFollowed}, x, y)));
        });
    for (std::uint64_t i = 0; i < 120; ++i) {
      v1::Frame frame;
      frame.set_sequence(i);
      frame.set_monotonic_ns(static_cast<std::int64_t>(i + 1) * 16'666'667);
      frame.set_wall_ns(frame.monotonic_ns());
      frame.mutable_jpeg()->set_data(jpeg.data(), jpeg.size());
      writer.add(frame);
      if (i > 0) continue;
      v1::Status status;
      status.set_light_followed(kFollowed);
      status.mutable_calibration()->set_name("toy");
      writer.add(status);
      writer.attach(recording::kCalibrationToml, "", base::read_file(at("cal/calibration.toml")));
      writer.attach(recording::kReferencePng, "", base::read_file(at("cal/reference.png")));
      writer.attach(recording::kCurrentReferencePng, "",
                    image::encode_png(image::Grey16{fakes::kToyWidth, fakes::kToyHeight,
                                                    fakes::toy_reference_q8()}));
    }
    writer.finish();
  }

  void reprocess(const std::string& from, const std::string& to) const {
    std::ostringstream out;
    std::ostringstream error;
    ASSERT_EQ(calibrate::run({"reprocess", at(from), "--calibration", at("cal"), "-o", at(to)}, out,
                             error),
              0)
        << error.str();
  }

  struct Read {
    std::vector<double> off_um;  ///< Each frame's median distance from zero.
    std::vector<v1::Status> statuses;
  };
  [[nodiscard]] Read read(const std::string& name) const {
    Read all;
    recording::RecordingHandlers handlers;
    handlers.frame = [&](const v1::Frame& frame, std::uint64_t) {
      EXPECT_FALSE(frame.contact().in_contact());
      std::vector<std::int16_t> um = client::values_of(frame.depth());
      std::ranges::nth_element(um, um.begin() + static_cast<std::ptrdiff_t>(um.size() / 2));
      all.off_um.push_back(std::abs(um[um.size() / 2]));
      return true;
    };
    handlers.status = [&](const v1::Status& status, std::uint64_t) {
      all.statuses.push_back(status);
      return true;
    };
    recording::read_recording(mcap::Reader(at(name)), handlers);
    return all;
  }

 private:
  calibration::TempFolder temp_;
};

// Before: the factor was read behind the frame that needs it, so that all depth was 70 µm too deep.
TEST_F(Reprocess, UsesTheLightThatTheDaemonFollowed) {
  record("a.mcap");
  reprocess("a.mcap", "b.mcap");
  reprocess("b.mcap", "c.mcap");
  for (const char* name : {"b.mcap", "c.mcap"}) {
    const Read made = read(name);
    EXPECT_THAT(made.off_um, SizeIs(120));
    EXPECT_THAT(made.off_um, Each(testing::Lt(10)));
    ASSERT_THAT(made.statuses, SizeIs(1));
    EXPECT_EQ(made.statuses[0].light_followed(), kFollowed);
    EXPECT_FALSE(made.statuses[0].has_calibration());
  }
}

}  // namespace
}  // namespace dtact::reprocess
