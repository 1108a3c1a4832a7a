// The tracked manual pages and completions equal those that the programs' texts make.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <map>
#include <regex>
#include <set>

#include "daemon/app/config_keys.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/manual/pages.hpp"
#include "tests/unit/manual/roff.hpp"

namespace dtact::manual {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::filesystem::path kRoot = DTACT_SOURCE_DIR;

TEST(Manual, IsThatOfTheProgramsAndTheConfiguration) {
  for (const File& file : all_files(kRoot)) {
    EXPECT_EQ(base::read_file(kRoot / file.path), file.text)
        << file.path << " is not what the programs say: run ./dev man and look at what changes";
  }
}

/// Matches of `pattern` in the tracked page.
std::set<std::string> found(const std::string& page, const std::string& pattern) {
  const std::string text = base::read_file(kRoot / page);
  const std::regex regex(pattern);
  return {std::sregex_token_iterator(text.begin(), text.end(), regex, 1),
          std::sregex_token_iterator()};
}

TEST(Manual, HasEveryKeyOfTheConfiguration) {
  std::set<std::string> keys;
  app::Config config;
  for (const app::Key& key : app::bind_keys(config)) keys.insert(key.path);
  EXPECT_EQ(found("config/dtactd.toml.5", R"(\.T[PQ]\n\\fB([a-z0-9_.]+)\\fR\n)"), keys);
}

TEST(Manual, RefusesAFileThatLacksAKeyOrHasOneTooMany) {
  const std::string toml = base::read_file(kRoot / "config/dtactd.toml");
  std::string lacks = toml;
  lacks.erase(lacks.find("seed = 1"), lacks.find("output = \"mjpeg\"") - lacks.find("seed = 1"));
  EXPECT_THAT([&] { (void)config_page(lacks); },
              ::testing::ThrowsMessage<std::runtime_error>(HasSubstr("camera.sim.seed")));
  EXPECT_THAT([&] { (void)config_page(toml + "colour = 1\n"); },
              ::testing::ThrowsMessage<std::runtime_error>(HasSubstr("metrics.colour")));
}

TEST(Manual, SaysOfAKeyItsCommentWhatIsAllowedAndTheDefault) {
  const std::string page = base::read_file(kRoot / "config/dtactd.toml.5");
  // The comment above the key.
  EXPECT_THAT(page, HasSubstr("\\fBcamera.light_delay_frames\\fR\nFrames after a light change"));
  // The comment behind the key; nothing twice where the comment is only the range.
  EXPECT_THAT(
      page,
      HasSubstr("\\fBcamera.sim.seed\\fR\nOf the noise and nothing else. A whole number, 0 …"));
  EXPECT_THAT(
      page,
      HasSubstr(
          "\\fBcamera.width\\fR\nA whole number, 16 … 8192 (pixels). Default: \\fB800\\fR.\n"));
  // Choices that the comment explains are not listed.
  EXPECT_THAT(page, testing::Not(HasSubstr("One of \"null\", \"sim\"")));
  // Several keys below one comment.
  EXPECT_THAT(
      page,
      HasSubstr("\\fBnet.tls_certificate\\fR\n.TQ\n\\fBnet.tls_key\\fR\nWith both TCP speaks"));
  // The default of a commented key depends on the machine.
  EXPECT_THAT(page, HasSubstr("\\fBcapture.cpu\\fR\nA whole number, 0 … 1023, or false.\n"));
}

TEST(Manual, SaysOfAnOptionWhatHelpSays) {
  CLI::App app("Does. More of it.", "program");
  double seconds = 5;
  std::vector<std::string> files;
  bool quiet = false;
  auto* listed = app.add_option("-s,--seconds", seconds, "Seconds to run")
                     ->capture_default_str()
                     ->check(CLI::PositiveNumber);
  app.add_option("FILES", files, "What to read")->check(CLI::ExistingFile);
  app.add_flag("--quiet", quiet, "Say nothing")->excludes(listed);
  const Command command = describe(app);
  ASSERT_EQ(command.options.size(), 3U);
  EXPECT_THAT(command.options[1].names, ElementsAre("-s", "--seconds"));
  EXPECT_EQ(command.options[1].value, "NUMBER");
  EXPECT_THAT(command.options[1].facts,
              ElementsAre("Above 0.", "Default: 5.", "Not with --quiet."));
  EXPECT_EQ(command.options[2].value, "");
  ASSERT_EQ(command.positionals.size(), 1U);
  EXPECT_EQ(command.positionals[0].value, "FILE");
  EXPECT_TRUE(command.positionals[0].repeats);
}

TEST(Manual, MakesSentences) {
  EXPECT_EQ(sentence("of the noise"), "Of the noise.");
  EXPECT_EQ(sentence("false: once"), "false: once.");
  EXPECT_EQ(sentence("depth.npy (float32 mm)"), "depth.npy (float32 mm).");
  EXPECT_EQ(sentence(""), "");
}

TEST(Manual, EscapesWhatRoffWouldRead) {
  EXPECT_EQ(escaped("--x `a^b` ~ \\ it's"), "\\-\\-x \\fBa\\(hab\\fR \\(ti \\e it\\(aqs");
  EXPECT_EQ(filled(".so file"), "\\&.so file\n");
}

}  // namespace
}  // namespace dtact::manual
