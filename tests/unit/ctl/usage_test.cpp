// dtactctl's messages for a command line that it does not understand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "clients/common/exit_codes.hpp"
#include "clients/common/program.hpp"
#include "clients/ctl/ctl.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::ctl {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::string reported(const std::vector<std::string>& arguments) {
  std::ostringstream out;
  std::ostringstream error;
  EXPECT_EQ(run(arguments, out, error), 2);
  EXPECT_EQ(out.str(), "");
  return error.str();
}

TEST(Usage, NamesTheWordThatIsNoCommand) {
  const std::string sentence = reported({"--port", "7400", "statsu"});
  EXPECT_THAT(sentence, StartsWith("dtactctl: \"statsu\" is no command; known are status, watch,"));
}

TEST(Usage, AsksForACommandWhereThereIsNone) {
  EXPECT_THAT(reported({"--port", "7400"}), HasSubstr("A subcommand is required"));
}

TEST(Usage, RefusesJsonWhereThereIsNothingToPrint) {
  EXPECT_THAT(reported({"rezero", "--json"}), HasSubstr("--json"));
  EXPECT_THAT(reported({"token", "--new", "view", "-o", "x", "--json"}), HasSubstr("--json"));
  EXPECT_THAT(reported({"watch", "--draw", "--json"}), HasSubstr("--json"));
}

// It passes comparisons with both ends of a range.
TEST(Usage, RefusesWhatIsNoNumber) {
  for (const char* number : {"nan", "NaN", "-nan", "inf", "1e-300", "1e300", "-1", "1x", ""}) {
    EXPECT_THAT(reported({"snapshot", "-o", "x.png", "--timeout", number}), HasSubstr("--timeout"))
        << number;
    EXPECT_THAT(reported({"camera", "--exposure", number}), HasSubstr("--exposure")) << number;
    EXPECT_THAT(reported({"reconstruction", "--max-error-um", number}), HasSubstr("--max-error-um"))
        << number;
  }
}

// The command line that a program asks its user to run again.
TEST(CommandLine, HoldsEveryOptionThatWasGiven) {
  CLI::App app("test", "dtact-calibrate");
  std::ostringstream out;
  cli::Context context{{}, false, out};
  cli::add_global_options(app, context);
  CLI::App* guided = app.add_subcommand("guided");
  std::string folder = "unchanged";
  std::vector<int> crop;
  bool force = false;
  guided->add_option("-f,--folder", folder);
  guided->add_option("--presses", folder);
  guided->add_option("--crop", crop)->delimiter(',')->expected(2);
  guided->add_flag("--force", force);
  std::ostringstream error;
  const std::vector<std::string> given = {
      "--host", "gripper",      "guided",  "--crop",        "500,400",
      "-f",     "it's a press", "--force", "--fingerprint", std::string(64, 'a')};
  ASSERT_EQ(cli::run(app, given, out, error), 0) << error.str();
  EXPECT_EQ(cli::command_line(*guided),
            "dtact-calibrate --host gripper --fingerprint " + std::string(64, 'a') +
                " guided --folder 'it'\\''s a press' --crop 500,400 --force");
}

TEST(Usage, NamesEveryMeaningOfExitCodeFour) {
  for (const char* meaning : {"watch --min-fps", "bench: no frame", "find, fleet: no daemon",
                              "setup: a step is not done", "guided: ended without a calibration"}) {
    EXPECT_THAT(cli::kExitCodesHelp, HasSubstr(meaning));
  }
}

TEST(Usage, SaysWhenTheOutputCouldNotBeWritten) {
  const calibration::TempFolder folder;
  std::ofstream full("/dev/full");
  std::ostringstream error;
  EXPECT_EQ(run({"token", "--new", "view", "-o", (folder.path() / "token").string()}, full, error),
            1);
  EXPECT_THAT(error.str(), HasSubstr("the output could not be written: is the disk full?"));
}

}  // namespace
}  // namespace dtact::ctl
