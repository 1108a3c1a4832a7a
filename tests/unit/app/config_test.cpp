#include "daemon/app/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <sstream>
#include <stdexcept>

#include "hal/base/atomic_file.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::app {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ConfigFile : public ::testing::Test {
 protected:
  void SetUp() override {
    ::unsetenv("DTACTD_LOG");
    folder_ = fakes::own_path();
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  Config load(const std::string& text, const std::vector<std::string>& settings = {}) {
    base::write_file_atomically(folder_ / "c.toml", text);
    return load_config(folder_ / "c.toml", settings).config;
  }
  std::string error(const std::string& text, const std::vector<std::string>& settings = {}) {
    try {
      (void)load(text, settings);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "no error";
  }

  fs::path folder_;
};

TEST_F(ConfigFile, EmptyFileKeepsTheDefaults) {
  const Config config = load("");
  EXPECT_EQ(config.hal.camera.backend, "sim");
  EXPECT_EQ(config.hal.camera.fps, 60);
  EXPECT_EQ(config.net.port, 7377);
  EXPECT_EQ(config.log_level, "info");
  EXPECT_FALSE(config.pipeline.light_delay_frames.has_value());
}

TEST_F(ConfigFile, SetsEveryKind) {
  const Config config = load(
      "log_level = 'debug'\n[camera]\nwidth = 640\nfps = 30\nlight_delay_frames = "
      "4\n[camera.replay]\nloop = false\n"
      "folder = 'frames'\n[ring]\nbrightness = 128\nscheme = 'scheme4'\n[capture]\ncpu = false\n"
      "[net]\nhello_timeout_ms = 250\n");
  EXPECT_EQ(config.log_level, "debug");
  EXPECT_EQ(config.hal.camera.width, 640);
  EXPECT_EQ(config.pipeline.light_delay_frames, 4);
  EXPECT_EQ(config.hal.camera.fps, 30);
  EXPECT_FALSE(config.hal.camera.replay.loop);
  EXPECT_EQ(config.hal.camera.replay.folder, folder_ / "frames");
  EXPECT_EQ(config.pipeline.light.brightness, 128);
  EXPECT_EQ(config.ring_scheme, "scheme4");
  EXPECT_FALSE(config.pipeline.cpu.has_value());
  EXPECT_EQ(config.net.hello_timeout.count(), 250);
}

TEST_F(ConfigFile, ReadsTheCamerasControls) {
  const Config config = load(
      "[camera]\nbackend = 'v4l2'\n[camera.v4l2]\ndevice = 'serial:7'\nexposure_us = 5000\n"
      "[camera.v4l2.controls]\ngain = 10\ngamma = 'default'\n[camera.libcamera.controls]\n"
      "analogue_gain = 1.5\n");
  EXPECT_EQ(config.hal.camera.v4l2.device, "serial:7");
  EXPECT_EQ(config.hal.camera.v4l2.exposure_us, 5000);
  EXPECT_EQ(config.hal.camera.v4l2.controls, (std::map<std::string, std::int64_t>{{"gain", 10}}));
  EXPECT_EQ(config.hal.camera.libcamera.controls,
            (std::map<std::string, double>{{"analogue_gain", 1.5}}));
  EXPECT_THAT(error("[camera.v4l2.controls]\ngain = 1.5\n"),
              HasSubstr("camera.v4l2.controls.gain"));
  EXPECT_THAT(error("[camera.v4l2.controls]\nzoom = 1\n"), HasSubstr("zoom"));
}

TEST_F(ConfigFile, SharpensByANumberOrAName) {
  const auto sharpen = [&](const std::string& value) {
    return load("[reconstruction]\nsharpen = " + value + "\n").pipeline.reconstruction.sharpen;
  };
  EXPECT_EQ(load("").pipeline.reconstruction.sharpen, 0);
  EXPECT_EQ(sharpen("'off'"), 0);
  EXPECT_EQ(sharpen("1"), 1);
  EXPECT_EQ(sharpen("2"), 2);
  EXPECT_EQ(sharpen("'auto'"), pipeline::ReconstructionRules::kAutoSharpen);
  for (const char* wrong : {"3", "0", "-1", "'2'", "1.0", "true"}) {
    EXPECT_THAT(error(std::string("[reconstruction]\nsharpen = ") + wrong + "\n"),
                AllOf(HasSubstr("reconstruction.sharpen"),
                      HasSubstr("one of \"off\", \"auto\", or 1 or 2")))
        << wrong;
  }
}

TEST_F(ConfigFile, ASecretMayBeACredential) {
  const Config config = load(
      "[net]\ntokens = 'credential:tokens'\ntls_key = 'keys/a.key'\n"
      "tls_certificate = 'keys/a.crt'\n");
  EXPECT_EQ(config.net.token_file, "credential:tokens");
  EXPECT_EQ(config.net.tls_key, folder_ / "keys/a.key");
  EXPECT_THAT(error("[net]\ntokens = 'credential:../tokens'\n"),
              HasSubstr("or \"credential:NAME\""));
  EXPECT_THAT(error("[net]\ntokens = 'credential:'\n"), HasSubstr("net.tokens"));
}

TEST_F(ConfigFile, UnknownKeyNamesFileLineAndWhatIsAllowed) {
  EXPECT_THAT(error("[camera]\nwidht = 640\n"),
              AllOf(HasSubstr("c.toml:2:"), HasSubstr("\"camera.widht\""),
                    HasSubstr("width, height, fps, decode_scale, light_delay_frames, [sim], "
                              "[replay], [v4l2], [libcamera]")));
  EXPECT_THAT(error("[camra]\n"), AllOf(HasSubstr("c.toml:1:"), HasSubstr("[camera]")));
}

TEST_F(ConfigFile, WrongTypeOrValueNamesWhatIsAllowed) {
  EXPECT_THAT(error("\n[camera]\nwidth = '640'\n"),
              AllOf(HasSubstr("c.toml:3: camera.width"), HasSubstr("16 … 8192")));
  EXPECT_THAT(error("[camera]\nfps = nan\n"), HasSubstr("camera.fps"));
  EXPECT_THAT(error("[camera.libcamera.controls]\nanalogue_gain = inf\n"),
              HasSubstr("camera.libcamera.controls.analogue_gain"));
  EXPECT_THAT(error("[camera]\nwidth = 640.5\n"), HasSubstr("camera.width"));
  EXPECT_THAT(error("[net]\nport = 65536\n"), HasSubstr("0 … 65535"));
  EXPECT_THAT(error("[camera]\nbackend = 'usb'\n"), HasSubstr("\"null\""));
  EXPECT_THAT(error("[ring]\nscheme = 'half'\n"), HasSubstr("scheme4"));
  EXPECT_THAT(error("camera = 3\n"), HasSubstr("c.toml:1"));
  EXPECT_THAT(error("[contact]\nthreshold_mm = 0.05\nrelease_mm = 0.05\n"),
              HasSubstr("contact.release_mm"));
}

TEST_F(ConfigFile, SettingsThatExcludeEachOtherAreBothNamed) {
  EXPECT_THAT(error("[reference]\nframes = 100\ntimeout_frames = 99\n"),
              AllOf(HasSubstr("reference.timeout_frames = 99"),
                    HasSubstr("at least reference.frames = 100")));
  EXPECT_THAT(
      error("[reference]\nframes = 8\nsettle_frames = 12\n", {"reference.timeout_frames=11"}),
      AllOf(HasSubstr("reference.timeout_frames = 11"),
            HasSubstr("at least reference.settle_frames = 12")));
  EXPECT_EQ(
      load("[reference]\nframes = 100\ntimeout_frames = 100\n").pipeline.reference.timeout_frames,
      100);
  EXPECT_THAT(
      error("[contact]\nthreshold_mm = 0.04\nrelease_mm = 0.05\n"),
      AllOf(HasSubstr("contact.release_mm = 0.05"), HasSubstr("contact.threshold_mm = 0.04")));
}

TEST_F(ConfigFile, WhatAStartRefusesIsRefused) {
  EXPECT_THAT(error("[net]\naddress = 'localhost'\n"),
              AllOf(HasSubstr("\"localhost\""), HasSubstr("write 127.0.0.1")));
  EXPECT_THAT(error("[net]\nfifo_priority = 45\n"),
              AllOf(HasSubstr("net.fifo_priority = 45"), HasSubstr("capture.fifo_priority = 40")));
  EXPECT_EQ(load("[capture]\nfifo_priority = 0\n").pipeline.fifo_priority, 0);
}

/// A key's range as config/dtactd.toml states it, with the next values outside.
struct Range {
  const char* key;
  const char* below;
  const char* least;
  const char* most;
  const char* above;
};

TEST_F(ConfigFile, EveryNumberHasTheRangeThatTheShippedFileStates) {
  constexpr Range kRanges[] = {
      {"camera.width", "15", "16", "8192", "8193"},
      {"camera.height", "15", "16", "8192", "8193"},
      {"camera.fps", "0.09", "0.1", "1000", "1000.1"},
      {"camera.light_delay_frames", "-1", "0", "64", "65"},
      {"ring.brightness", "-1", "0", "255", "256"},
      {"ring.ws2812.gamma", "0.19", "0.2", "5", "5.1"},
      {"ring.ws2812.first_led", "-1", "0", "7", "8"},
      {"capture.fifo_priority", "-1", "0", "99", "100"},
      {"reconstruction.max_error_um", "0.9", "1", "10000", "10000.1"},
      {"reference.frames", "0", "1", "256", "257"},
      {"reference.settle_frames", "1", "2", "64", "65"},
      {"reference.settle_grey", "0.009", "0.01", "16", "16.1"},
      {"reference.drift_limit_percent", "-0.1", "0", "5", "5.1"},
      {"reference.drift_percent_per_minute", "0.009", "0.01", "60", "60.1"},
      {"contact.area_mm2", "0.0009", "0.001", "1000", "1000.1"},
      {"contact.debounce_frames", "0", "1", "1000", "1001"},
      {"net.port", "-1", "0", "65535", "65536"},
      {"net.max_clients", "0", "1", "1024", "1025"},
      {"net.max_clients_per_address", "0", "1", "1024", "1025"},
      {"net.max_requests_per_s", "0", "1", "100000", "100001"},
      {"net.hello_timeout_ms", "99", "100", "600000", "600001"},
      {"net.peer_timeout_ms", "999", "1000", "600000", "600001"},
      {"metrics.port", "-1", "0", "65535", "65536"}};
  for (const Range& range : kRanges) {
    const std::string key = range.key;
    for (const char* value : {range.least, range.most}) {
      EXPECT_EQ(error("", {key + "=" + value}), "no error") << key;
    }
    for (const char* value : {range.below, range.above}) {
      EXPECT_THAT(error("", {key + "=" + value}),
                  AllOf(HasSubstr(key), HasSubstr(std::string(range.least) + " … " + range.most)))
          << value;
    }
  }
}

// Where one key's range depends on another's value.
TEST_F(ConfigFile, RangesThatDependOnOthersReachTheirEnds) {
  EXPECT_EQ(error("", {"contact.threshold_mm=0.005", "contact.release_mm=0.001"}), "no error");
  EXPECT_EQ(error("", {"contact.threshold_mm=5", "contact.release_mm=4.999"}), "no error");
  EXPECT_THAT(error("", {"contact.threshold_mm=0.0049", "contact.release_mm=0.001"}),
              HasSubstr("0.005 … 5"));
  EXPECT_THAT(error("", {"contact.threshold_mm=5.1"}), HasSubstr("0.005 … 5"));
  EXPECT_THAT(error("", {"contact.release_mm=0.0009"}), HasSubstr("0.001 … 5"));

  EXPECT_EQ(error("", {"reference.frames=1", "reference.settle_frames=12",
                       "reference.timeout_frames=12"}),
            "no error");
  EXPECT_THAT(error("", {"reference.frames=13", "reference.settle_frames=2",
                         "reference.timeout_frames=12"}),
              HasSubstr("at least reference.frames = 13"));

  // As high as the capture thread's it would delay frames.
  EXPECT_EQ(error("", {"net.fifo_priority=39"}), "no error");
  EXPECT_THAT(error("", {"net.fifo_priority=40"}), HasSubstr("clients would delay frames"));
  EXPECT_EQ(error("", {"capture.fifo_priority=1", "net.fifo_priority=0"}), "no error");
  EXPECT_THAT(error("", {"capture.fifo_priority=1", "net.fifo_priority=1"}),
              HasSubstr("clients would delay frames"));
  EXPECT_EQ(error("", {"capture.fifo_priority=0", "net.fifo_priority=99"}), "no error");
  EXPECT_THAT(error("", {"capture.fifo_priority=0", "net.fifo_priority=100"}), HasSubstr("0 … 99"));
  EXPECT_THAT(error("", {"net.fifo_priority=-1"}), HasSubstr("0 … 99"));
}

TEST_F(ConfigFile, FramesAreDecodedAtASizeOfWholePixels) {
  EXPECT_THAT(error("[camera]\nwidth = 642\ndecode_scale = 4\n"),
              AllOf(HasSubstr("camera.decode_scale = 4"), HasSubstr("642x600")));
  EXPECT_THAT(error("[camera]\nheight = 482\ndecode_scale = 4\n"), HasSubstr("800x482"));
  EXPECT_THAT(error("[camera]\ndecode_scale = 3\n"), HasSubstr("camera.decode_scale"));
  EXPECT_THAT(error("[camera]\nbackend = \"null\"\ndecode_scale = 2\n"),
              AllOf(HasSubstr("camera.decode_scale = 2"), HasSubstr("camera.backend = \"null\"")));
  EXPECT_THAT(error("[camera]\ndecode_scale = 2\n[camera.sim]\noutput = \"yuyv\"\n"),
              HasSubstr("camera.sim.output = \"yuyv\""));
  EXPECT_THAT(error("[camera]\nbackend = \"v4l2\"\ndecode_scale = 2\n[camera.v4l2]\n"
                    "pixel_format = \"grey\"\n"),
              HasSubstr("camera.v4l2.pixel_format = \"grey\""));
  EXPECT_EQ(load("[camera]\nbackend = \"v4l2\"\ndecode_scale = 2\n").hal.camera.decode_scale, 2);
  EXPECT_EQ(load("[camera]\nwidth = 642\ndecode_scale = 2\n").hal.camera.decode_scale, 2);
}

// Several daemons spread over the CPUs unless one is configured.
TEST_F(ConfigFile, SaysWhetherTheCpuWasChosen) {
  EXPECT_TRUE(load("").cpu_is_default);
  EXPECT_FALSE(load("[capture]\ncpu = 0\n").cpu_is_default);
  EXPECT_FALSE(load("", {"capture.cpu=false"}).cpu_is_default);
}

// An empty area would be in contact for ever.
TEST_F(ConfigFile, ContactNeedsAnArea) {
  EXPECT_THAT(error("[contact]\narea_mm2 = 0.0\n"),
              AllOf(HasSubstr("c.toml:2: contact.area_mm2"), HasSubstr("0.001 … 1000")));
}

TEST_F(ConfigFile, ReadsTheRingsPowerLine) {
  const hal::GpioLineConfig power =
      load("[ring.ws2812.power]\nname = 'GPIO17'\nbias = 'pull-down'\n").hal.ring.ws2812.power;
  EXPECT_EQ(power.name, "GPIO17");
  EXPECT_EQ(power.bias, "pull-down");
  EXPECT_TRUE(power.is_set());
  EXPECT_FALSE(load("").hal.ring.ws2812.power.is_set());
  EXPECT_THAT(error("[ring.ws2812.power]\nname = 'GPIO17'\nline = 17\n"),
              HasSubstr("line = 17 and name = \"GPIO17\": set the one or the other"));
  EXPECT_THAT(error("[ring.ws2812.power]\nchip = 'gpiochip0'\n"),
              HasSubstr("line = -1 and name = \"\": set the one or the other"));
  EXPECT_THAT(error("[ring.ws2812.power]\nbias = 'up'\n"),
              AllOf(HasSubstr("ring.ws2812.power.bias"), HasSubstr("\"pull-up\"")));
}

TEST_F(ConfigFile, WhatIsGoneSaysWhyAndWhatToDo) {
  EXPECT_THAT(error("[ring]\nbackend = 'ws2812_gpio'\n"),
              AllOf(HasSubstr("c.toml:2: ring.backend: \"ws2812_gpio\" is gone"),
                    HasSubstr("use ring.backend = \"ws2812_pio\" on a Raspberry Pi 5")));
  EXPECT_THAT(error("", {"ring.backend=ws2812_gpio"}), HasSubstr("--set: ring.backend"));
  EXPECT_THAT(error("[ring.ws2812]\ngpio_priority = 60\n"),
              HasSubstr("c.toml:2: ring.ws2812.gpio_priority: is gone"));
  EXPECT_THAT(error("[ring.ws2812]\ngpio_retries = 5\n"),
              AllOf(HasSubstr("gpio_retries: is gone"), HasSubstr("remove it")));
  EXPECT_THAT(error("[ring.ws2812.data]\nchip = ''\n"),
              HasSubstr("c.toml:1: ring.ws2812.data: is gone"));
}

TEST_F(ConfigFile, BrokenTomlNamesTheLine) {
  EXPECT_THAT(error("[camera]\nwidth = = 3\n"), HasSubstr("c.toml:2"));
}

TEST_F(ConfigFile, MissingFileIsNamed) {
  EXPECT_THROW((void)load_config(folder_ / "none.toml", {}), std::exception);
}

TEST_F(ConfigFile, SettingsWinOverTheFile) {
  const Config config =
      load("[camera]\nfps = 30\n", {"camera.fps=15", "camera.backend=null", "net.port=0"});
  EXPECT_EQ(config.hal.camera.fps, 15);
  EXPECT_EQ(config.hal.camera.backend, "null");
  EXPECT_EQ(config.net.port, 0);
}

TEST_F(ConfigFile, WrongSettingIsNamed) {
  EXPECT_THAT(error("", {"camera.fps"}), HasSubstr("KEY=VALUE"));
  EXPECT_THAT(error("", {"camera.fps=fast"}), HasSubstr("camera.fps"));
  EXPECT_THAT(error("", {"camera.speed=1"}), HasSubstr("camera.speed"));
}

TEST_F(ConfigFile, EnvironmentSetsTheLogLevel) {
  ::setenv("DTACTD_LOG", "trace", 1);
  EXPECT_EQ(load("log_level = 'warn'\n").log_level, "trace");
  EXPECT_EQ(load("", {"log_level=error"}).log_level, "error");
  ::setenv("DTACTD_LOG", "loud", 1);
  EXPECT_THAT(error(""), HasSubstr("DTACTD_LOG"));
  ::unsetenv("DTACTD_LOG");
}

TEST_F(ConfigFile, OpensTheNetworkOnlyWithTlsAndTokens) {
  EXPECT_THAT(error("[net]\naddress = '0.0.0.0'\n"),
              AllOf(HasSubstr("net.tls_certificate"), HasSubstr("net.tokens"),
                    HasSubstr("net.listen_insecure = true")));
  EXPECT_TRUE(load("[net]\naddress = '0.0.0.0'\nlisten_insecure = true\n").net.insecure);
  const Config config = load(
      "[net]\naddress = '::'\ntls_certificate = 'a.crt'\ntls_key = 'a.key'\n"
      "tokens = '/etc/tokens'\nunix_socket = '/run/s'\nmax_clients_per_address = 3\n"
      "max_requests_per_s = 7\n");
  EXPECT_EQ(config.net.tls_certificate, folder_ / "a.crt");
  EXPECT_EQ(config.net.tls_key, folder_ / "a.key");
  EXPECT_EQ(config.net.token_file, "/etc/tokens");
  EXPECT_EQ(config.net.unix_socket, "/run/s");
  EXPECT_EQ(config.net.max_clients_per_address, 3U);
  EXPECT_EQ(config.net.max_requests_per_s, 7);
}

TEST_F(ConfigFile, PrintedConfigSaysWhereAValueCameFromAndLoadsAgain) {
  base::write_file_atomically(folder_ / "c.toml", "[camera]\nwidth = 640\n");
  std::ostringstream out;
  print_config(load_config(folder_ / "c.toml", {"camera.fps=15"}), out);
  EXPECT_THAT(out.str(), HasSubstr("c.toml:2"));
  EXPECT_THAT(out.str(), HasSubstr("# --set"));
  EXPECT_THAT(out.str(), HasSubstr("# default"));
  const Config again = load(out.str());
  EXPECT_EQ(again.hal.camera.width, 640);
  EXPECT_EQ(again.hal.camera.fps, 15);
}

TEST_F(ConfigFile, TheShippedFileHoldsTheDefaults) {
  const LoadedConfig defaults = load_config({}, {});
  const LoadedConfig shipped = load_config(fs::path(DTACT_SOURCE_DIR) / "config/dtactd.toml", {});
  std::ostringstream a;
  std::ostringstream b;
  LoadedConfig plain = shipped;
  plain.origins = defaults.origins;
  print_config(defaults, a);
  print_config(plain, b);
  EXPECT_EQ(a.str(), b.str());
  // The shipped file has every key; the CPU depends on the machine and is a comment there.
  for (const KeyOrigin& key : shipped.origins) {
    if (key.key != "capture.cpu") {
      EXPECT_THAT(key.origin, HasSubstr("dtactd.toml:")) << key.key;
    }
  }
}

}  // namespace
}  // namespace dtact::app
