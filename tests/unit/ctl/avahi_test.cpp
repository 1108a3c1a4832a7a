#include "clients/ctl/avahi.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <sstream>

#include "clients/ctl/ctl.hpp"

namespace dtact::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(Txt, IsRead) {
  cli::FoundDaemon found;
  read_txt({"version=1.2.3", "serial=A=\x1b[2J\xff", "tls=1", "token=0", "colour=red", "odd", ""},
           found);
  EXPECT_EQ(found.version(), "1.2.3");
  EXPECT_EQ(found.serial(), "A=?[2J?");
  EXPECT_TRUE(found.tls());
  EXPECT_FALSE(found.token());
}

TEST(Find, SaysThatThereIsNoAvahi) {
  ::setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/no/such/bus", 1);
  std::ostringstream out;
  std::ostringstream error;
  EXPECT_EQ(run({"find"}, out, error), 1);
  EXPECT_THAT(error.str(), AllOf(HasSubstr("no avahi-daemon to ask (no system bus: "),
                                 HasSubstr("apt-get install avahi-daemon, or name the daemon's "
                                           "machine with --host")));
  ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
}

}  // namespace
}  // namespace dtact::ctl
