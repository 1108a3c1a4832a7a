#pragma once

#include <gtest/gtest.h>

#include "daemon/recon/vector_targets.hpp"
// After vector_targets.hpp:
#include <hwy/highway.h>
#include <hwy/targets.h>

#include <cstdint>
#include <string>

namespace dtact::recon {

/// A test that runs once on each instruction set that this machine and the build of the kernels
/// have.
class EveryTarget : public testing::TestWithParam<std::int64_t> {
 protected:
  void SetUp() override { hwy::SetSupportedTargetsForTest(GetParam()); }
  void TearDown() override { hwy::SetSupportedTargetsForTest(0); }
};

inline std::string target_of(const testing::TestParamInfo<std::int64_t>& info) {
  return hwy::TargetName(info.param);
}

}  // namespace dtact::recon

#define DTACT_EVERY_TARGET(suite)                                                                 \
  INSTANTIATE_TEST_SUITE_P(Target, suite, testing::ValuesIn(hwy::SupportedAndGeneratedTargets()), \
                           dtact::recon::target_of)
