#include "clients/common/sibling.hpp"

#include <unistd.h>

#include <filesystem>
#include <system_error>

namespace dtact::cli {

std::string sibling(const std::string& program) {
  std::error_code unknown;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", unknown);
  const std::string beside = (self.parent_path() / program).string();
  return !unknown && ::access(beside.c_str(), X_OK) == 0 ? beside : program;
}

}  // namespace dtact::cli
