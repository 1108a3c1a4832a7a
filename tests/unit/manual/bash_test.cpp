// Completion files in a real bash; dtactctl's and dtact-calibrate's are tested with dtactctl.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <set>
#include <stdexcept>
#include <string>

#include "tests/unit/manual/pages.hpp"

namespace dtact::manual {
namespace {

struct Completion {
  std::string file;      ///< In the tree.
  std::string function;  ///< In the file.
};
const Completion kDtactd{"daemon/dtactd.bash-completion", "_dtactd"};
const Completion kPerceive{"clients/perceive/dtact-perceive.bash-completion", "_dtact_perceive"};
const Completion kDds{"clients/dds/dtact-dds.bash-completion", "_dtact_dds"};
const Completion kWeb{"clients/web/dtact-web.bash-completion", "_dtact_web"};

/// Words that bash offers for the last of `words`, which are separated by blanks.
std::set<std::string> offered(const Completion& completion, const std::string& words) {
  const std::string command = "bash --norc -c 'source \"" DTACT_SOURCE_DIR "/" + completion.file +
                              "\"; COMP_WORDS=(" + words +
                              "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); " + completion.function +
                              "; printf \"%s\\n\" \"${COMPREPLY[@]}\"'";
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("no bash");
  std::set<std::string> found;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) {
    std::string line = buffer.data();
    line.pop_back();
    found.insert(line);
  }
  ::pclose(pipe);
  return found;
}

std::set<std::string> options_of(const Command& command) {
  std::set<std::string> options;
  for (const Argument& option : command.options) options.insert(option.names.back());
  return options;
}

TEST(Bash, OffersEveryOptionOfDtactd) {
  EXPECT_EQ(offered(kDtactd, "dtactd --"), options_of(dtactd()));
}

TEST(Bash, OffersLevels) {
  EXPECT_THAT(offered(kDtactd, "dtactd --log-level w"), testing::ElementsAre("warn"));
}

TEST(Bash, OffersUnits) {
  EXPECT_THAT(offered(kPerceive, "dtact-perceive serve --object-unit \"\""),
              testing::UnorderedElementsAre("mm", "m"));
}

/// Checks the options of a program and of each of its commands.
void expect_every_option(const Completion& completion, const Command& program) {
  EXPECT_EQ(offered(completion, program.name + " --"), options_of(program));
  for (const Command& command : program.commands) {
    std::set<std::string> options = options_of(command);
    options.insert("--help");
    const std::string line = program.name + " --host gripper " + command.name + " --";
    EXPECT_EQ(offered(completion, line), options);
    EXPECT_THAT(offered(completion, program.name + " " + command.name.substr(0, 1)),
                testing::Contains(command.name));
  }
}

TEST(Bash, OffersEveryOptionOfDtactPerceive) { expect_every_option(kPerceive, dtact_perceive()); }

TEST(Bash, OffersEveryOptionOfDtactDds) { expect_every_option(kDds, dtact_dds()); }

TEST(Bash, OffersEveryOptionOfDtactWeb) { expect_every_option(kWeb, dtact_web()); }

}  // namespace
}  // namespace dtact::manual
