#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string_view>

namespace dtact::fakes {

/// A path in the temporary folder that is unique to the running test and to this build.
/// Call it in a test.
inline std::filesystem::path own_path(std::string_view ending = "") {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  return std::filesystem::path(::testing::TempDir()) /
         fmt::format("dtact_{}_{}_{}{}", test->test_suite_name(), test->name(), ::getpid(), ending);
}

}  // namespace dtact::fakes
