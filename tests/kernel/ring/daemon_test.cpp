// dtactd and its ring on the real spidev driver. Runs in the guest; spi-mock, which makes the node,
// is loaded and unloaded while the daemon runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <string>
#include <vector>

#include "clients/cpp/client.hpp"
#include "tests/e2e/daemon_process.hpp"
#include "tests/kernel/ring/spi_mock.hpp"

namespace dtact::kernel_test {
namespace {

using testing::HasSubstr;

class RingDaemon : public testing::Test {
 protected:
  [[nodiscard]] v1::Status status() const {
    client::Client asking(client::Options{.host = "127.0.0.1", .port = daemon_.port()});
    return asking.status();
  }
  [[nodiscard]] bool in_trouble() const {
    const auto health = status().health();
    return std::ranges::find(health, v1::HEALTH_RING_FAULT) != health.end();
  }
  int ctl(std::vector<std::string> arguments, std::string& output) const {
    arguments.insert(arguments.begin(),
                     {DTACTCTL_PROGRAM, "--port", std::to_string(daemon_.port())});
    return e2e::run_program(arguments, &output);
  }
  /// The last colours on the wire are eight times this grey.
  static bool grey_on_the_wire(std::uint8_t grey) {
    const auto pictures = spi_mock::pictures();
    return !pictures.empty() && spi_mock::shown_by(pictures.back()) ==
                                    std::vector<hal::Rgb>(8, hal::Rgb{grey, grey, grey});
  }

  e2e::TempFolder state_;
  e2e::DaemonProcess daemon_{{"--set", "camera.backend=null", "--set", "ring.backend=ws2812_spi",
                              "--set", "ring.ws2812.gamma=1", "--set", "ring.ws2812.resend_ms=100",
                              "--set", "ring.ws2812.spi_check_rate=false", "--set", "net.port=0",
                              "--set", "state_dir=" + state_.path().string()}};
};

TEST_F(RingDaemon, ComesUpWithoutTheRingAndLightsItOnceItIsThere) {
  ASSERT_TRUE(eventually([&] { return in_trouble(); }));
  EXPECT_THAT(status().ring().message(),
              HasSubstr("/dev/spidev0.0: cannot be opened: No such file or directory"));
  EXPECT_THAT(status().advice(), HasSubstr("dtparam=spi=on"));
  EXPECT_THAT(daemon_.log(), HasSubstr("no LED ring yet, it is looked for: /dev/spidev0.0"));

  std::string reported;
  EXPECT_NE(ctl({"led", "--brightness", "100"}, reported), 0);
  EXPECT_THAT(reported, HasSubstr("No such file or directory"));
  EXPECT_THAT(reported, HasSubstr("The light is kept and shown when the ring is back"));
  EXPECT_EQ(ctl({"led"}, reported), 0);
  EXPECT_THAT(reported, HasSubstr("/dev/spidev0.0: cannot be opened"));

  spi_mock::load();
  ASSERT_TRUE(eventually([&] { return grey_on_the_wire(100); }));
  ASSERT_TRUE(eventually([&] { return !in_trouble(); }));
  EXPECT_EQ(status().ring().message(), "");
  EXPECT_EQ(status().light().brightness(), 100U);

  spi_mock::unload();
  ASSERT_TRUE(eventually([&] { return in_trouble(); }));
  EXPECT_THAT(status().ring().message(), HasSubstr("/dev/spidev0.0"));
  spi_mock::load();
  ASSERT_TRUE(eventually([&] { return grey_on_the_wire(100); }));
  ASSERT_TRUE(eventually([&] { return !in_trouble(); }));

  EXPECT_EQ(daemon_.stop(SIGTERM), 0);
  EXPECT_TRUE(grey_on_the_wire(0));
  spi_mock::unload();
}

}  // namespace
}  // namespace dtact::kernel_test
