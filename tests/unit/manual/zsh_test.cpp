// zsh's completions in a real zsh, compared with the programs' own help.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>

#include "tests/fakes/own_path.hpp"
#include "tests/unit/manual/pages.hpp"

namespace dtact::manual {
namespace {

namespace fs = std::filesystem;
using ::testing::IsSubsetOf;

using Words = std::set<std::string>;

class Zsh : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v zsh >/dev/null") != 0) GTEST_SKIP() << "zsh is not installed";
    folder_ = fakes::own_path();
    fs::create_directories(folder_);
    const fs::path root = DTACT_SOURCE_DIR;
    for (const File& file : all_files(root)) {
      if (file.path.extension() != ".zsh-completion") continue;
      fs::create_symlink(root / file.path, folder_ / ("_" + file.path.stem().string()));
    }
  }
  void TearDown() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }

  /// The words offered at the end of each line.
  [[nodiscard]] std::map<std::string, Words> offers(const std::vector<std::string>& lines) const {
    std::string command =
        fmt::format("cd '{0}' && timeout 100 '{1}/tests/unit/manual/zsh_offers.zsh' '{0}'",
                    folder_.string(), DTACT_SOURCE_DIR);
    std::map<std::string, Words> found;
    for (const std::string& line : lines) {
      command += " '" + line + "'";
      found[line];
    }
    FILE* pipe = ::popen(command.c_str(), "r");
    if (pipe == nullptr) throw std::runtime_error("no shell");
    std::array<char, 4096> buffer{};
    while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) {
      const std::string line = buffer.data();
      const auto tab = line.find('\t');
      found[line.substr(0, tab)].insert(line.substr(tab + 1, line.size() - tab - 2));
    }
    ::pclose(pipe);
    return found;
  }

  fs::path folder_;
};

Words long_names(const std::vector<Argument>& options) {
  Words names;
  for (const Argument& option : options) names.insert(option.names.back());
  return names;
}

/// Collects the words that must be offered behind each command line of a program with commands.
void collect(const std::string& line, const Command& command, const Words& everywhere,
             std::map<std::string, Words>& expected) {
  Words options = long_names(command.options);
  options.insert(everywhere.begin(), everywhere.end());
  expected[line + " --"] = options;
  for (const Command& below : command.commands) {
    expected[line + " "].insert(below.name);
    collect(line + " " + below.name, below, everywhere, expected);
  }
}

TEST_F(Zsh, OffersEveryCommandAndOption) {
  std::map<std::string, Words> expected;
  for (const Command& program :
       {dtactctl(), dtact_calibrate(), dtact_perceive(), dtact_web(), dtact_dds(), dtactd()}) {
    collect(program.name, program, long_names(program.options), expected);
  }
  std::vector<std::string> lines;
  for (const auto& [line, words] : expected) lines.push_back(line);
  // dtactctl, its 17 commands, 7 of calibration, 3 of fleet; dtact-calibrate, its 9, 5 of objects;
  // dtact-perceive and its 2; dtact-web; dtact-dds; dtactd.
  EXPECT_EQ(lines.size(), 1U + 17 + 7 + 3 + 3 + 1 + 9 + 6 + 1 + 1 + 2 + 1 + 1 + 1 + 1);
  for (const auto& [line, words] : offers(lines)) {
    EXPECT_THAT(expected.at(line), IsSubsetOf(words)) << line;
  }
}

TEST_F(Zsh, OffersValuesAndFiles) {
  std::fclose(std::fopen((folder_ / "press.mcap").c_str(), "w"));
  fs::create_directory(folder_ / "calibration");
  const Words files{"calibration", "press.mcap",      "_dtactctl",  "_dtact-calibrate",
                    "_dtactd",     "_dtact-perceive", "_dtact-web", "_dtact-dds"};
  const std::map<std::string, Words> expected{
      {"dtactctl export press.mcap --to ", {"npy", "png", "ply", "pcd", "csv"}},
      {"dtact-calibrate depth --method=p", {"published"}},
      {"dtactctl token --new ", {"view", "control", "calibrate"}},
      {"dtactctl export ", files},
      {"dtactd --config ", files},
      {"dtactctl calibration upload ", {"calibration"}},
      {"dtact-calibrate apply --calibration ", {"calibration"}},
      {"dtactctl led --brightness ", {}},
      // --summary is not offered: it excludes --draw.
      {"dtactctl watch --draw --s", {"--seconds"}},
      {"dtactctl --port 7 s", {"setup", "status", "snapshot"}}};
  std::vector<std::string> lines;
  for (const auto& [line, words] : expected) lines.push_back(line);
  EXPECT_EQ(offers(lines), expected);
}

}  // namespace
}  // namespace dtact::manual
