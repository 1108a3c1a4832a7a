#include "hal/base/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <stdexcept>
#include <system_error>

#include "hal/base/unique_fd.hpp"

namespace dtact::base {
namespace {

[[noreturn]] void fail(int error, const char* what, const std::filesystem::path& path) {
  throw std::system_error(error, std::generic_category(), std::string(what) + " " + path.string());
}

}  // namespace

void sync_folder(const std::filesystem::path& folder) {
  const auto& path = folder.empty() ? std::filesystem::path(".") : folder;
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd) fail(errno, "cannot open folder", path);
  if (::fsync(fd.get()) != 0 && errno != EINVAL) fail(errno, "cannot sync folder", path);
}

void write_file_atomically(const std::filesystem::path& path, std::string_view content,
                           mode_t mode) {
  std::string temporary = path.string() + ".XXXXXX";
  UniqueFd fd(::mkostemp(temporary.data(), O_CLOEXEC));
  if (!fd) fail(errno, "cannot write", path);
  const auto give_up = [&](int error) {
    ::unlink(temporary.c_str());
    fail(error, "cannot write", path);
  };
  while (!content.empty()) {
    const ssize_t n = ::write(fd.get(), content.data(), content.size());
    if (n < 0) {
      if (errno == EINTR) continue;
      give_up(errno);
    }
    content.remove_prefix(static_cast<std::size_t>(n));
  }
  // mkostemp makes the file private.
  if (::fchmod(fd.get(), mode) != 0) give_up(errno);
  if (::fsync(fd.get()) != 0) give_up(errno);
  fd.reset();
  if (std::rename(temporary.c_str(), path.c_str()) != 0) give_up(errno);
  sync_folder(path.parent_path());
}

std::string read_file(const std::filesystem::path& path, std::size_t limit) {
  // A pipe that nobody writes into is empty, instead of being waited for; one with a writer is
  // read.
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!fd || ::fcntl(fd.get(), F_SETFL, 0) != 0) fail(errno, "cannot read", path);
  std::string content;
  char buffer[65536];
  for (;;) {
    const ssize_t n = ::read(fd.get(), buffer, sizeof buffer);
    if (n < 0) {
      if (errno == EINTR) continue;
      fail(errno, "cannot read", path);
    }
    if (n == 0) return content;
    content.append(buffer, static_cast<std::size_t>(n));
    if (content.size() > limit) fail(EFBIG, "cannot read", path);
  }
}

std::string read_text_file(const std::filesystem::path& path, std::size_t limit) {
  std::string content = read_file(path, limit);
  if (content.starts_with("\xEF\xBB\xBF")) content.erase(0, 3);
  return content;
}

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(int error, const std::string& what) {
  throw std::system_error(error, std::generic_category(), what);
}

/// Removes a folder on the way out, whatever happened.
class Scratch {
 public:
  explicit Scratch(fs::path path) : path_(std::move(path)) {}
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  [[nodiscard]] const fs::path& path() const noexcept { return path_; }

 private:
  fs::path path_;
};

void refuse_foreign(const fs::path& folder, const std::vector<std::string>& known,
                    const std::string& what) {
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder.string() + " exists and is not a folder; name another one");
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path name = entry.path().filename();
    if (std::ranges::find(known, name.string()) == known.end()) {
      throw std::runtime_error(
          fmt::format("{} is not replaced because {} in it is no part of {}; name another folder",
                      folder.string(), name.string(), what));
    }
  }
}

/// Exchanges `fresh` and `target`: the old target is at `fresh` afterwards.
void exchange(const fs::path& fresh, const fs::path& target) {
  if (::renameat2(AT_FDCWD, fresh.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) return;
  if (errno != EINVAL && errno != ENOSYS) fail(errno, "cannot replace " + target.string());
  // This file system cannot exchange: for a moment there is no folder, never a mixture.
  const fs::path aside = fresh.string() + ".old";
  fs::rename(target, aside);
  fs::rename(fresh, target);
  fs::rename(aside, fresh);
}

}  // namespace

void write_folder_atomically(const fs::path& folder, const FolderFiles& files,
                             const std::vector<std::string>& known, const std::string& what) {
  // A trailing slash has no file name, and a link stays while the folder behind it is replaced.
  fs::path target = fs::weakly_canonical(fs::absolute(folder));
  if (!target.has_filename()) target = target.parent_path();
  if (!target.has_filename()) {
    throw std::runtime_error(folder.string() + " cannot be " + what + "; name a folder");
  }
  const bool replaces = fs::exists(target);
  if (replaces) refuse_foreign(target, known, what);

  std::string name = (target.parent_path() / ("." + target.filename().string() + ".XXXXXX"));
  if (::mkdtemp(name.data()) == nullptr) fail(errno, "cannot write beside " + target.string());
  const Scratch scratch{name};
  if (::chmod(name.c_str(), 0755) != 0) fail(errno, "cannot write " + name);
  for (const auto& [file, content] : files) write_file_atomically(scratch.path() / file, content);
  if (replaces) {
    exchange(scratch.path(), target);
  } else {
    fs::rename(scratch.path(), target);
  }
  sync_folder(target.parent_path());
}

}  // namespace dtact::base
