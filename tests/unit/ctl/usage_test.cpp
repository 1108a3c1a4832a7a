// What dtactctl says of a command line that it does not understand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "clients/ctl/ctl.hpp"

namespace dtact::ctl {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::string told(const std::vector<std::string>& arguments) {
  std::ostringstream out;
  std::ostringstream error;
  EXPECT_EQ(run(arguments, out, error), 2);
  EXPECT_EQ(out.str(), "");
  return error.str();
}

TEST(Usage, NamesTheWordThatIsNoCommand) {
  const std::string sentence = told({"--port", "7400", "statsu", "--json"});
  EXPECT_THAT(sentence, StartsWith("dtactctl: \"statsu\" is no command; known are status, watch,"));
}

TEST(Usage, AsksForACommandWhereThereIsNone) {
  EXPECT_THAT(told({"--port", "7400"}), HasSubstr("A subcommand is required"));
}

TEST(Usage, SaysWhenTheOutputCouldNotBeWritten) {
  std::ofstream full("/dev/full");
  std::ostringstream error;
  EXPECT_EQ(run({"token", "--new", "view"}, full, error), 1);
  EXPECT_THAT(error.str(), HasSubstr("the output could not be written: is the disk full?"));
}

}  // namespace
}  // namespace dtact::ctl
