// dtact-perceive's options that it refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "clients/common/exit_codes.hpp"
#include "clients/perceive/perceive.hpp"

namespace dtact::perceive {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Ended {
  int code = 0;
  std::string error;
};
Ended ran(const std::vector<std::string>& arguments) {
  std::ostringstream out;
  std::ostringstream error;
  const int code = run(arguments, out, error);
  return {code, error.str()};
}

TEST(Options, AnOpenAddressIsRefusedByTheOptionsThatGuardIt) {
  const Ended ended = ran({"serve", "--listen", "0.0.0.0", "--listen-port", "0"});
  EXPECT_NE(ended.code, cli::kOk);
  EXPECT_THAT(ended.error,
              AllOf(HasSubstr("--listen \"0.0.0.0\""), HasSubstr("--tokens"),
                    HasSubstr("--tls-certificate and --tls-key"), HasSubstr("--listen-insecure"),
                    HasSubstr("may watch;"), Not(HasSubstr("net."))));
}

TEST(Options, AUnitWithoutAnObjectIsRefused) {
  EXPECT_EQ(ran({"serve", "--listen", "nowhere", "--object-unit", "m"}).code, cli::kUsage);
}

}  // namespace
}  // namespace dtact::perceive
