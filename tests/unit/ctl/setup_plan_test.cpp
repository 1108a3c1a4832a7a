#include "clients/ctl/setup_plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "clients/common/exit_codes.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::ctl {
namespace {

using hal::v4l2::Mode;
using testing::AllOf;
using testing::HasSubstr;

Mode mode(std::uint32_t fourcc, int width, int height, std::vector<double> fps) {
  Mode made;
  made.fourcc = fourcc;
  made.width = made.min_width = width;
  made.height = made.min_height = height;
  made.fps = std::move(fps);
  return made;
}

std::string error(const std::string& toml, const Settings& settings) {
  try {
    return "no error: " + with_settings(toml, settings, "c.toml");
  } catch (const std::runtime_error& e) {
    return e.what();
  }
}

TEST(SetupPlan, SetsValuesAndKeepsAllElse) {
  EXPECT_EQ(with_settings("# head\nlog_level = \"info\"  # how much\n\n[camera]\n"
                          "backend = \"sim\"\nwidth = 800   # pixels # of a row\nheight=600\n\n"
                          "# [camera.v4l2] is below\n[camera.v4l2] # USB\n# Which one\n"
                          "device = \"a # b\"  # a name\n",
                          {{"camera.width", "1280"},
                           {"camera.height", "720"},
                           {"camera.backend", "\"v4l2\""},
                           {"camera.v4l2.device", "\"serial:7\""},
                           {"log_level", "\"debug\""}},
                          "c.toml"),
            "# head\nlog_level = \"debug\" # how much\n\n[camera]\n"
            "backend = \"v4l2\"\nwidth = 1280  # pixels # of a row\nheight=720\n\n"
            "# [camera.v4l2] is below\n[camera.v4l2] # USB\n# Which one\n"
            "device = \"serial:7\" # a name\n");
}

TEST(SetupPlan, AddsKeysAndTablesThatAreMissing) {
  EXPECT_EQ(with_settings("[camera]\nwidth = 640\n\n# About the ring.\n[ring]\n",
                          {{"camera.fps", "30.00"},
                           {"state_dir", "\"/tmp\""},
                           {"ring.backend", "\"null\""},
                           {"ring.ws2812.spi_bits", "3"}},
                          "c.toml"),
            "state_dir = \"/tmp\"\n[camera]\nwidth = 640\nfps = 30.00\n\n# About the ring.\n"
            "[ring]\nbackend = \"null\"\n\n[ring.ws2812]\nspi_bits = 3\n");
  EXPECT_EQ(with_settings("", {{"camera.width", "640"}}, "c.toml"), "\n[camera]\nwidth = 640\n");
}

TEST(SetupPlan, RefusesWhatItCannotEdit) {
  EXPECT_THAT(error("camera.width = 640\n", {{"camera.width", "800"}}),
              AllOf(HasSubstr("c.toml: cannot set camera.width"), HasSubstr("to 800 by hand")));
  EXPECT_THAT(error("camera = { width = 640 }\n", {{"camera.width", "800"}}), HasSubstr("by hand"));
  EXPECT_THAT(error("[camera]\nwidth = \n", {{"camera.width", "800"}}), HasSubstr("c.toml:2"));
}

TEST(SetupPlan, TheShippedConfigurationTakesEveryBoard) {
  const std::string shipped = base::read_file(DTACT_SOURCE_DIR "/config/dtactd.toml");
  const auto comments = [](const std::string& text) { return std::ranges::count(text, '#'); };
  int boards = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DTACT_SOURCE_DIR "/config/boards")) {
    if (entry.path().extension() != ".toml") continue;
    ++boards;
    const std::string name = entry.path().string();
    const Settings wanted = settings_of(base::read_file(name), name);
    const std::string text = with_settings(shipped, wanted, "dtactd.toml");
    EXPECT_EQ(comments(text), comments(shipped)) << name;
    const Settings all = settings_of(text, name);
    for (const Setting& setting : wanted) EXPECT_THAT(all, testing::Contains(setting)) << name;
    EXPECT_EQ(with_settings(text, wanted, name), text) << name;
  }
  EXPECT_GE(boards, 4);
}

TEST(SetupPlan, TakesTheModeNearestToTheDaemons) {
  constexpr std::uint32_t kMjpeg = V4L2_PIX_FMT_MJPEG;
  constexpr std::uint32_t kYuyv = V4L2_PIX_FMT_YUYV;
  EXPECT_EQ(best_mode({}), std::nullopt);
  EXPECT_EQ(best_mode({mode(V4L2_PIX_FMT_SBGGR8, 800, 600, {60})}), std::nullopt);
  EXPECT_EQ(best_mode({mode(kMjpeg, 1920, 1080, {30}), mode(kYuyv, 640, 480, {30, 15}),
                       mode(kMjpeg, 800, 600, {120, 60.00024, 30}), mode(kYuyv, 800, 600, {15})}),
            (ModeChoice{800, 600, 60}));
  EXPECT_EQ(best_mode({mode(kMjpeg, 1280, 720, {60}), mode(kYuyv, 640, 480, {30})}),
            (ModeChoice{640, 480, 30}));
  // Nothing is quick: the quickest.
  EXPECT_EQ(best_mode({mode(kYuyv, 800, 600, {5}), mode(kYuyv, 320, 240, {25})}),
            (ModeChoice{320, 240, 25}));
  Mode range = mode(kYuyv, 1600, 1200, {90, 1});
  range.min_width = 16;
  range.min_height = 16;
  range.fps_is_range = true;
  EXPECT_EQ(best_mode({range}), (ModeChoice{800, 600, 60}));
}

TEST(SetupPlan, FindsTheDaemonOfAConfiguration) {
  const auto target = [](const std::string& net, const std::string& unit = "dtactd") {
    return target_of("[net]\n" + net, unit, "/etc/dtactd/c.toml");
  };
  EXPECT_EQ(target(""), (DaemonTarget{"", ""}));
  EXPECT_EQ(target("port = 7400"), (DaemonTarget{"", "7400"}));
  EXPECT_EQ(target("address = \"::\"\nport = 7400"), (DaemonTarget{"", "7400"}));
  EXPECT_EQ(target("address = \"192.0.2.7\"\nport = 7400"), (DaemonTarget{"192.0.2.7", "7400"}));
  // Without TCP the port says nothing.
  EXPECT_EQ(target("address = \"\"\nport = 0"), (DaemonTarget{"unix:/run/dtactd/dtactd.sock", ""}));
  EXPECT_EQ(target("address = \"\"", "dtactd@left"),
            (DaemonTarget{"unix:/run/dtactd/left/dtactd.sock", ""}));
  EXPECT_EQ(target("address = \"\"\nunix_socket = \"/run/a.sock\"", "dtactd@left"),
            (DaemonTarget{"unix:/run/a.sock", ""}));
  EXPECT_EQ(target("address = \"\"\nunix_socket = \"a.sock\""),
            (DaemonTarget{"unix:/etc/dtactd/a.sock", ""}));
  for (const char* wrong : {"0", "70000", "99999999999", "-1", "7377.0", "\"7377\""}) {
    EXPECT_THAT([&] { (void)target(std::string("port = ") + wrong); },
                testing::ThrowsMessage<cli::Failure>(
                    AllOf(HasSubstr("/etc/dtactd/c.toml: net.port"), HasSubstr("1 to 65535"))))
        << wrong;
  }
}

TEST(SetupPlan, ReadsAMode) {
  EXPECT_EQ(parse_mode("500x400@29.97"), (ModeChoice{500, 400, 29.97}));
  EXPECT_EQ(text_of(parse_mode("800x600@60")), "800x600@60");
  for (const char* wrong : {"800x600", "800@60", "800x600@", "x", ""}) {
    EXPECT_THROW((void)parse_mode(wrong), std::runtime_error) << wrong;
  }
}

TEST(SetupPlan, RecognisesBoardsThatHaveAConfiguration) {
  EXPECT_EQ(board_of("PC"), "");
  for (const char* model :
       {"Raspberry Pi 5 Model B Rev 1.0", "Raspberry Pi 4 Model B Rev 1.5", "Radxa ROCK 5B"}) {
    EXPECT_TRUE(
        std::filesystem::exists(DTACT_SOURCE_DIR "/config/boards/" + board_of(model) + ".toml"))
        << model;
  }
}

}  // namespace
}  // namespace dtact::ctl
