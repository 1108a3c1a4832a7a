#include "clients/common/sibling.hpp"

#include <unistd.h>

#include <filesystem>
#include <system_error>

namespace dtact::cli {

std::string own_folder() {
  std::error_code unknown;
  return std::filesystem::read_symlink("/proc/self/exe", unknown).parent_path().string();
}

std::string sibling(const std::string& program) {
  const std::string beside = own_folder() + '/' + program;
  return ::access(beside.c_str(), X_OK) == 0 ? beside : program;
}

}  // namespace dtact::cli
