// The doctor on real device nodes. Runs in the guest, with spi-mock loaded in real time.
#include "daemon/app/doctor/doctor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <sstream>

#include "tests/kernel/ring/guest.hpp"

namespace dtact::app {
namespace {

using kernel_test::AsNobody;
using kernel_test::write_text;
using testing::HasSubstr;
using testing::Not;

hal::Config spi_config() {
  hal::Config config;
  config.ring.backend = "ws2812_spi";
  return config;
}

TEST(DoctorInTheGuest, FindsNothingWrongWithTheSpiRing) {
  write_text("/sys/kernel/debug/spi_mock/realtime", "1");
  std::ostringstream out;
  (void)doctor(spi_config(), out);
  std::printf("%s", out.str().c_str());
  EXPECT_THAT(out.str(), HasSubstr("spi          ok     /dev/spidev0.0 may be opened"));
  EXPECT_THAT(out.str(), HasSubstr("spi          ok     spidev.bufsiz = 4096, the ring needs 336"));
  EXPECT_THAT(out.str(), HasSubstr("spi          ok     measured rate"));
  EXPECT_THAT(out.str(), Not(HasSubstr("spi          WRONG")));
}

TEST(DoctorInTheGuest, ReportsAnUnprivilegedUserWhatToDo) {
  const AsNobody nobody;
  std::ostringstream out;
  EXPECT_EQ(doctor(spi_config(), out), 1);
  std::printf("%s", out.str().c_str());
  EXPECT_THAT(out.str(), HasSubstr("spi          WRONG  /dev/spidev0.0: Permission denied"));
  EXPECT_THAT(out.str(), HasSubstr("sudo usermod -aG spi nobody"));
}

}  // namespace
}  // namespace dtact::app
