#include "daemon/app/options.hpp"

#include <gtest/gtest.h>

namespace dtact::app {
namespace {

Parsed parse(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "dtactd");
  return parse_options(static_cast<int>(arguments.size()), arguments.data());
}

TEST(Options, NothingMeansDefaults) {
  const Parsed parsed = parse({});
  EXPECT_FALSE(parsed.exit_status.has_value());
  EXPECT_FALSE(parsed.options.config.has_value());
  EXPECT_TRUE(parsed.options.settings.empty());
}

TEST(Options, SettingsKeepTheirOrder) {
  const Parsed parsed = parse({"--set", "a=1", "--set", "b=2", "--print-config"});
  EXPECT_EQ(parsed.options.settings, (std::vector<std::string>{"a=1", "b=2"}));
  EXPECT_TRUE(parsed.options.print_config);
}

TEST(Options, LogLevelIsASetting) {
  EXPECT_EQ(parse({"--log-level", "debug"}).options.settings,
            std::vector<std::string>{"log_level='debug'"});
}

TEST(Options, AReportIsTheDoctors) {
  EXPECT_TRUE(parse({"--doctor", "--report"}).options.report);
  EXPECT_FALSE(parse({"--doctor"}).options.report);
  EXPECT_EQ(parse({"--report"}).exit_status, 2);
}

TEST(Options, HelpAndVersionEndWell) {
  EXPECT_EQ(parse({"--help"}).exit_status, 0);
  EXPECT_EQ(parse({"--version"}).exit_status, 0);
}

TEST(Options, MistakesEndWithTwo) {
  EXPECT_EQ(parse({"--nonsense"}).exit_status, 2);
  EXPECT_EQ(parse({"--config", "/nonexistent/file"}).exit_status, 2);
}

}  // namespace
}  // namespace dtact::app
