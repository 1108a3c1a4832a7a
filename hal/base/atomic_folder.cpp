#include "hal/base/atomic_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>

#include "hal/base/atomic_file.hpp"

namespace dtact::base {
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

/// Puts `fresh` in the place of `target`; what was there lies at `fresh` afterwards.
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
