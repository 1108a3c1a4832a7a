// dtactctl calibration against the server with a store and a pipeline that the tests play.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "clients/cpp/client.hpp"
#include "clients/ctl/calibration_text.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/ctl/run_ctl.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using net::test::answer_done;
using net::test::Rig;
using test::ctl;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

/// Lets the pipeline report that it uses the calibration `name`.
void be_calibrated(Rig& rig, const std::string& name) {
  auto calibration = std::make_shared<calibration::Calibration>();
  calibration->name = name;
  pipeline::Status status;
  status.calibration = std::move(calibration);
  rig.port.set_status(status);
}

TEST(Calibration, GoesUpAndComesBack) {
  Rig rig({}, answer_done);
  be_calibrated(rig, "first");
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path temporary = ::mkdtemp(name.data());
  const fs::path folder = temporary / "ball";
  fs::create_directory(folder);
  base::write_file_atomically(folder / "calibration.toml", "version = 1\n");
  base::write_file_atomically(folder / "reference.png", "png");

  auto result = ctl(rig, {"calibration", "upload", folder.string() + "/"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out, "the daemon uses calibration ball (4) from now on\n");
  EXPECT_EQ(ctl(rig, {"calibration", "show"}).out, "# calibration ball (4)\nversion = 1\n");
  const std::string copy = (temporary / "copy").string();
  result = ctl(rig, {"calibration", "download", "-o", copy});
  EXPECT_EQ(result.out, copy + ": calibration ball (4)\n");
  EXPECT_EQ(base::read_file(copy + "/reference.png"), "png");
  EXPECT_EQ(base::read_file(copy + "/calibration.toml"), "version = 1\n");
  result = ctl(rig, {"calibration", "upload", folder.string(), "--name", "other", "--json"});
  EXPECT_EQ(result.out, R"({"number":5,"name":"other","folder":"","removed":[2]})"
                        "\n");
  result = ctl(rig, {"calibration", "upload", folder.string(), "--name", "no good"});
  EXPECT_EQ(result.code, 1);
  EXPECT_EQ(ctl(rig, {"calibration", "upload", temporary.string()}).code, 1);
  fs::remove_all(temporary);
}

TEST(Calibration, IsExportedOnceUnlessForced) {
  const Rig rig({}, answer_done);
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path temporary = ::mkdtemp(name.data());
  const std::string folder = (temporary / "factory").string();
  auto result = ctl(rig, {"calibration", "download", "configured", "-o", folder, "--json"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out,
            R"({"number":0,"name":"factory","folder":")" + folder + "\",\"removed\":[]}\n");
  result = ctl(rig, {"calibration", "download", "2", "-o", folder});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr(folder + " exists"), HasSubstr("--force")));
  EXPECT_EQ(base::read_file(folder + "/calibration.toml"), "toml of factory");
  EXPECT_EQ(ctl(rig, {"calibration", "download", "2", "-o", folder, "--force"}).code, 0);
  EXPECT_EQ(base::read_file(folder + "/calibration.toml"), "bad");
  // Files that are no part of a calibration are kept, with --force and without.
  base::write_file_atomically(folder + "/notes.txt", "mine");
  EXPECT_EQ(ctl(rig, {"calibration", "download", "1", "-o", folder, "--force"}).code, 1);
  EXPECT_EQ(base::read_file(folder + "/calibration.toml"), "bad");
  EXPECT_EQ(ctl(rig, {"calibration", "download", "9", "-o", (temporary / "x").string()}).code, 1);
  EXPECT_FALSE(fs::exists(temporary / "x"));
  fs::remove_all(temporary);
}

TEST(Calibration, IsListed) {
  Rig rig;
  be_calibrated(rig, "first");
  EXPECT_EQ(
      ctl(rig, {"calibration", "list"}).out,
      "          id  uploaded              name         image        map    mm/px  method     "
      "range\n"
      "  configured  -                     factory    800x600    580x580   0.0414  lut        "
      "-0.02 "
      "to 1.40 mm\n"
      "*          1  2026-01-31T12:00:00Z  first      800x600    580x580   0.0414  lut        "
      "-0.02 "
      "to 1.40 mm\n"
      "           2  2026-01-31T12:00:00Z  broken   cannot be read: calibration.toml:3: scale "
      "missing\n"
      "           3  2026-01-31T12:00:00Z  stuck      800x600    580x580   0.0414  lut        "
      "-0.02 "
      "to 1.40 mm\n");
  const std::string json = ctl(rig, {"calibration", "list", "--json"}).out;
  EXPECT_THAT(
      json,
      StartsWith(R"({"number":0,"name":"factory","uploaded":"","current":false,"summary":{)"
                 R"("name":"factory","method":"lut","mm_per_px":0.0414,"width":580,"height":580,)"
                 R"("covered_from_mm":-0.02,"covered_to_mm":1.4,"created":"","frame_width":800,)"
                 R"("frame_height":600,"sharpen_steps":[]},"in_use":false,"pinned":false})"
                 "\n"));
  EXPECT_THAT(json, HasSubstr(R"("name":"broken","uploaded":"2026-01-31T12:00:00Z",)"
                              R"("current":false,"damage":"calibration.toml:3: scale missing",)"));
  EXPECT_EQ(std::count(json.begin(), json.end(), '\n'), 4);
}

TEST(Calibration, IsDescribedInALine) {
  v1::CalibrationSummary summary;
  summary.set_name("ball");
  summary.set_method("model");
  summary.set_width(500);
  summary.set_height(400);
  summary.set_frame_width(1280);
  summary.set_frame_height(720);
  summary.set_mm_per_px(0.0417);
  summary.set_covered_from_mm(-0.02);
  summary.set_covered_to_mm(1.4);
  summary.set_created("2026-01-31");
  EXPECT_EQ(text_of(summary),
            "ball, method model, 500x400 of 1280x720 at 0.0417 mm/px, covers -0.02 to 1.40 mm, "
            "2026-01-31");
  summary.add_sharpen_steps(1);
  summary.add_sharpen_steps(2);
  EXPECT_THAT(text_of(summary), HasSubstr("1.40 mm, sharpens by 1 or 2, 2026-01-31"));
  std::vector<v1::StoredCalibration> all(2);
  all[0].set_number(1234567890123);
  all[0].set_name("a longer name");
  all[0].set_pinned(true);
  all[0].set_current(true);
  *all[0].mutable_summary() = summary;
  all[1].set_number(7);
  all[1].set_uploaded("2026-01-31T12:00:00Z");
  all[1].set_name("b");
  all[1].set_in_use(true);
  all[1].set_current(true);
  *all[1].mutable_summary() = summary;
  EXPECT_EQ(text_of(all),
            "             id  uploaded              name               image        map    mm/px  "
            "method     range\n"
            "> 1234567890123  -                     a longer name   1280x720    500x400   0.0417  "
            "model      -0.02 to 1.40 mm, pinned\n"
            "*             7  2026-01-31T12:00:00Z  b               1280x720    500x400   0.0417  "
            "model      -0.02 to 1.40 mm\n");
}

TEST(Calibration, InUseAndToStartWithAreDistinguished) {
  Rig rig({}, answer_done);
  EXPECT_THAT(ctl(rig, {"calibration", "list"}).out,
              AllOf(HasSubstr("\n>          1"), EndsWith("none is in use\n"
                                                          "the daemon starts with 1 (>)\n")));
  be_calibrated(rig, "stuck");
  EXPECT_EQ(ctl(rig, {"calibration", "activate", "3"}).code, 1);  // disk full
  EXPECT_THAT(ctl(rig, {"calibration", "list"}).out,
              AllOf(HasSubstr("\n>          1"), HasSubstr("\n*          3"),
                    EndsWith("mm\nthe daemon starts with 1 (>)\n")));
  be_calibrated(rig, "ball");
  client::Options target;
  target.port = rig.tcp_port();
  v1::UploadCalibration files;
  files.set_name("ball");
  files.set_calibration_toml("unwritable");
  files.set_reference_png("png");
  EXPECT_THROW(client::Client(target).upload_calibration(files), client::Refused);
  EXPECT_THAT(ctl(rig, {"calibration", "list"}).out,
              AllOf(HasSubstr("\n>          1"), Not(HasSubstr("\n*")),
                    EndsWith("in use is ball, under no number that the daemon knows\n"
                             "the daemon starts with 1 (>)\n")));
}

TEST(Calibration, IsShownAndActivatedByItsId) {
  const Rig rig({}, answer_done);
  EXPECT_EQ(ctl(rig, {"calibration", "show", "configured"}).out,
            "# calibration factory (configured)\ntoml of factory");
  EXPECT_EQ(ctl(rig, {"calibration", "show", "1", "--json"}).out,
            // The files in base64.
            R"({"name":"first","calibration_toml":"dG9tbCBvZiBmaXJzdA==",)"
            R"("reference_png":"cG5nIG9mIGZpcnN0","number":1})"
            "\n");
  EXPECT_EQ(ctl(rig, {"calibration", "activate", "configured"}).out,
            "the daemon uses calibration configured from now on\n");
  EXPECT_EQ(ctl(rig, {"calibration", "activate", "1", "--json"}).out,
            R"({"number":1,"name":"","folder":"","removed":[]})"
            "\n");
  const auto refused = ctl(rig, {"calibration", "activate", "2"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.error, HasSubstr("scale missing"));
  const auto wrong = ctl(rig, {"calibration", "show", "newest"});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.error, HasSubstr("a number that dtactctl calibration list shows"));
  EXPECT_EQ(ctl(rig, {"calibration", "show", "0"}).code, 2);
  EXPECT_EQ(ctl(rig, {"calibration", "activate"}).code, 2);
  EXPECT_EQ(ctl(rig, {"calibration", "download"}).code, 2);
}

}  // namespace
}  // namespace dtact::ctl
