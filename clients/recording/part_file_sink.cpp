#include "clients/recording/part_file_sink.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <system_error>

namespace dtact::recording {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPart = ".part";

/// Empty for what is no regular file.
std::string part_of(const std::string& file) {
  if (!fs::exists(file)) return file + std::string(kPart);
  if (!fs::is_regular_file(file)) return {};
  // A link stays one; what it points to is replaced.
  return fs::canonical(file).string() + std::string(kPart);
}

base::UniqueFd lock(const std::string& part) {
  if (part.empty()) return {};
  base::UniqueFd fd(::open(part.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644));
  // Without locks, as on some network file systems, it goes as well. The sink says what else fails.
  if (fd && ::flock(fd.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    throw std::runtime_error(part + ": another program is writing it; name another file");
  }
  return fd;
}

/// Returns `file`. Throws unless it may be written.
std::string checked(std::string file, bool replace) {
  if (replace || !fs::exists(file)) return file;
  throw std::runtime_error(file + " exists: name another file, or add --force");
}

}  // namespace

PartFileSink::PartFileSink(const std::string& file, bool replace)
    : file_(checked(file, replace)),
      replace_(replace),
      part_(part_of(file)),
      lock_(lock(part_)),
      sink_(part_.empty() ? file : part_, true, file) {}

PartFileSink::~PartFileSink() {
  std::error_code ignored;
  if (!part_.empty()) fs::remove(part_, ignored);
}

void PartFileSink::give_name() {
  if (part_.empty()) return;
  const std::string name = part_.substr(0, part_.size() - kPart.size());
  const auto move = [&](unsigned flags) {
    return ::renameat2(AT_FDCWD, part_.c_str(), AT_FDCWD, name.c_str(), flags) == 0 ? 0 : errno;
  };
  int error = move(replace_ ? 0U : unsigned{RENAME_NOREPLACE});
  // Some network file systems cannot look and rename in one step.
  if (error == EINVAL && !replace_) error = fs::exists(name) ? EEXIST : move(0);
  if (error != 0) {
    throw std::runtime_error(fmt::format("{} cannot be given the name {}: {}", part_, file_,
                                         std::generic_category().message(error)));
  }
  part_.clear();
}

}  // namespace dtact::recording
