#include "hal/base/cpu_claim.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <optional>
#include <string>

namespace dtact::base {
namespace {

const std::string kName = "cpu-claim-test-" + std::to_string(::getpid());

cpu_set_t set_of(std::initializer_list<int> numbers) {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  for (const int cpu : numbers) CPU_SET(static_cast<std::size_t>(cpu), &cpus);
  return cpus;
}

TEST(CpuClaim, SpreadsOverTheAllowedCpusFromTheLastOn) {
  const cpu_set_t cpus = set_of({1, 2, 5});
  const CpuClaim first(cpus, kName);
  std::optional<CpuClaim> second(std::in_place, cpus, kName);
  const CpuClaim third(cpus, kName);
  const CpuClaim fourth(cpus, kName);
  EXPECT_EQ(first.cpu(), 5);
  EXPECT_EQ(second->cpu(), 2);
  EXPECT_EQ(third.cpu(), 1);
  EXPECT_EQ(fourth.cpu(), 5);  // a second round
  second.reset();
  EXPECT_EQ(CpuClaim(cpus, kName).cpu(), 2);
}

TEST(CpuClaim, AmongOthersOfItsNameOnly) {
  const CpuClaim one(set_of({3}), kName + "-a");
  const CpuClaim other(set_of({0, 3}), kName + "-b");
  EXPECT_EQ(one.cpu(), 3);
  EXPECT_EQ(other.cpu(), 3);
}

}  // namespace
}  // namespace dtact::base
