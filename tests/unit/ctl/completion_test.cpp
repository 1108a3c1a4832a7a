// The completion file in a real bash, compared with the program's own help.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/calibrate/calibrate.hpp"
#include "clients/ctl/ctl.hpp"

namespace dtact::ctl {
namespace {

using testing::IsSubsetOf;
using testing::UnorderedElementsAre;

/// Words that bash offers for the last of `words`, which are separated by blanks ("" if empty).
std::set<std::string> complete(const std::string& words) {
  const std::string script =
      "source '" DTACT_SOURCE_DIR "/clients/common/dtact.bash-completion'; COMP_WORDS=(" + words +
      "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _dtact; "
      "printf '%s\\n' \"${COMPREPLY[@]}\"";
  std::string quoted;
  for (const char c : script) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  FILE* pipe = ::popen(("bash --norc -c '" + quoted + "'").c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("no bash");
  std::string text;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) text += buffer.data();
  ::pclose(pipe);
  std::istringstream lines(text);
  std::set<std::string> found;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) found.insert(line);
  }
  return found;
}

using Run = int (*)(const std::vector<std::string>&, std::ostream&, std::ostream&);

/// The long options that a program's help for a command names.
std::set<std::string> options_of(Run run, std::vector<std::string> command) {
  command.emplace_back("--help");
  std::ostringstream out;
  std::ostringstream error;
  EXPECT_EQ(run(command, out, error), 0);
  const std::string help = out.str();
  // Options begin a line of the help; others are only mentioned.
  const std::regex option(R"(\n  (?:-\w,)?(--[a-z0-9-]+))");
  std::set<std::string> found;
  for (std::sregex_iterator match(help.begin(), help.end(), option), end; match != end; ++match) {
    found.insert((*match)[1]);
  }
  return found;
}

TEST(Completion, OffersCommands) {
  EXPECT_THAT(complete("dtactctl re"), UnorderedElementsAre("rezero", "record", "reconstruction"));
  EXPECT_THAT(complete("dtactctl --port 7 s"), UnorderedElementsAre("status", "snapshot", "setup"));
  EXPECT_THAT(complete("dtactctl calibration \"\""),
              UnorderedElementsAre("upload", "list", "show", "activate", "download", "pin", "unpin",
                                   "--help"));
  EXPECT_THAT(complete("dtactctl fleet --daemon left=gripper re"), UnorderedElementsAre("rezero"));
  EXPECT_THAT(complete("dtact-calibrate re"), UnorderedElementsAre("reprocess"));
}

TEST(Completion, OffersValues) {
  EXPECT_THAT(complete("dtactctl led --scheme scheme"),
              UnorderedElementsAre("scheme1", "scheme2", "scheme3", "scheme4"));
  EXPECT_THAT(complete("dtact-calibrate depth --method p"), UnorderedElementsAre("published"));
  EXPECT_THAT(complete("dtact-calibrate depth --method m"), UnorderedElementsAre("model"));
  EXPECT_THAT(complete("dtact-calibrate guided --method \"\""),
              UnorderedElementsAre("auto", "list", "model"));
  EXPECT_THAT(complete("dtact-calibrate guided --method auto --rad"),
              UnorderedElementsAre("--radius-mm"));
  EXPECT_THAT(complete("dtactctl reconstruction --resolution q"), UnorderedElementsAre("quarter"));
  EXPECT_THAT(complete("dtactctl led --brightness \"\""), UnorderedElementsAre());
  EXPECT_THAT(complete("dtactctl export press.mcap --to p"),
              UnorderedElementsAre("pcd", "ply", "png"));
}

void expect_options(const std::string& program, Run run,
                    const std::vector<std::vector<std::string>>& commands) {
  for (const auto& command : commands) {
    std::string words = program + " ";
    for (const auto& word : command) words += word + " ";
    EXPECT_THAT(options_of(run, command), IsSubsetOf(complete(words + "--"))) << words;
    EXPECT_FALSE(options_of(run, command).empty()) << words;
  }
}

TEST(Completion, KnowsEveryOptionOfEveryCommand) {
  expect_options("dtactctl", ctl::run,
                 {{},
                  {"status"},
                  {"camera"},
                  {"cameras"},
                  {"watch"},
                  {"setup"},
                  {"bench"},
                  {"find"},
                  {"fleet"},
                  {"fleet", "status"},
                  {"fleet", "upload"},
                  {"fleet", "rezero"},
                  {"led"},
                  {"rezero"},
                  {"reconstruction"},
                  {"snapshot"},
                  {"record"},
                  {"export"},
                  {"cert"},
                  {"token"},
                  {"calibration", "upload"},
                  {"calibration", "list"},
                  {"calibration", "show"},
                  {"calibration", "activate"},
                  {"calibration", "pin"},
                  {"calibration", "unpin"},
                  {"calibration", "download"}});
  expect_options("dtact-calibrate", calibrate::run,
                 {{},
                  {"guided"},
                  {"depth"},
                  {"lens"},
                  {"import"},
                  {"apply"},
                  {"reprocess"},
                  {"evaluate"},
                  {"force"}});
}

}  // namespace
}  // namespace dtact::ctl
