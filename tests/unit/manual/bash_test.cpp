// dtactd's completion file in a real bash; that of the clients is tested with dtactctl.
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

/// What bash offers for the last of `words`, which are separated by blanks.
std::set<std::string> offered(const std::string& words) {
  const std::string command =
      "bash --norc -c 'source \"" DTACT_SOURCE_DIR
      "/daemon/dtactd.bash-completion\"; COMP_WORDS=(" +
      words +
      "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _dtactd; printf \"%s\\n\" \"${COMPREPLY[@]}\"'";
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

TEST(Bash, OffersEveryOptionOfDtactd) {
  std::set<std::string> options;
  for (const Argument& option : dtactd().options) options.insert(option.names.back());
  EXPECT_EQ(offered("dtactd --"), options);
}

TEST(Bash, OffersLevels) {
  EXPECT_THAT(offered("dtactd --log-level w"), testing::ElementsAre("warn"));
}

}  // namespace
}  // namespace dtact::manual
