#include "tests/fakes/file_log.hpp"

#include <dlfcn.h>
#include <stdio.h>
#include <unistd.h>

#include <regex>

namespace dtact::fakes {
namespace {

thread_local FileLog* current = nullptr;

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

std::string path_of(int fd) {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd), error).string();
}

}  // namespace

FileLog::FileLog(const std::filesystem::path& folder)
    : folder_(std::filesystem::canonical(folder)) {
  current = this;
}

FileLog::~FileLog() { current = nullptr; }

void FileLog::add(const std::string& what, const std::string& path, const std::string& to) {
  static const std::regex kTemporary("\\.[A-Za-z0-9]{6}$");
  const auto shown = [this](const std::string& p) {
    const auto relative = std::filesystem::path(p).lexically_relative(folder_).string();
    return std::regex_replace(relative, kTemporary, ".XXXXXX");
  };
  const std::string from = shown(path);
  if (from.empty() || from.starts_with("..")) return;  // outside the folder
  calls_.push_back(what + " " + from + (to.empty() ? "" : " to " + shown(to)));
}

}  // namespace dtact::fakes

// The C library's own functions, which these replace: an executable's symbols come first.
using dtact::fakes::current;
using dtact::fakes::next;
using dtact::fakes::path_of;

extern "C" {

ssize_t write(int fd, const void* bytes, size_t size) {
  if (current != nullptr) current->add("write", path_of(fd));
  static auto* const real = next<decltype(write)>("write");
  return real(fd, bytes, size);
}

int fsync(int fd) {
  if (current != nullptr) current->add("sync", path_of(fd));
  static auto* const real = next<decltype(fsync)>("fsync");
  return real(fd);
}

int rename(const char* from, const char* to) noexcept {
  if (current != nullptr) current->add("rename", from, to);
  static auto* const real = next<decltype(rename)>("rename");
  return real(from, to);
}

}  // extern "C"
