#include "clients/common/sibling_program.hpp"

#include <unistd.h>

#include <filesystem>
#include <system_error>

namespace dtact::cli {

std::string own_folder() {
  std::error_code unknown;
  return std::filesystem::read_symlink("/proc/self/exe", unknown).parent_path().string();
}

std::string sibling(const std::string& program) {
  const std::string folder = own_folder();
  const std::string beside = folder + '/' + program;
  return !folder.empty() && ::access(beside.c_str(), X_OK) == 0 ? beside : program;
}

}  // namespace dtact::cli
