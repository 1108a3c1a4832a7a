#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <cerrno>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "daemon/calibration/calibration.hpp"
#include "daemon/calibration/text.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::calibration {
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

/// A folder is replaced only when it holds nothing that a calibration doesn't.
void refuse_foreign(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder.string() + " exists and is not a folder; name another one");
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path name = entry.path().filename();
    if (name != kTomlName && name != kReferenceName) {
      throw std::runtime_error(fmt::format(
          "{} is not replaced because {} in it is no part of a calibration; name another folder",
          folder.string(), name.string()));
    }
  }
}

/// Puts `fresh` in the place of `target`; what was there lies at `fresh` afterwards.
void exchange(const fs::path& fresh, const fs::path& target) {
  if (::renameat2(AT_FDCWD, fresh.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) return;
  if (errno != EINVAL && errno != ENOSYS) fail(errno, "cannot replace " + target.string());
  // This file system cannot exchange: for a moment there is no folder, which a reader reports as no
  // calibration and never as a mixture.
  const fs::path aside = fresh.string() + ".old";
  fs::rename(target, aside);
  fs::rename(fresh, target);
  fs::rename(aside, fresh);
}

}  // namespace

Calibration load(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder.string() +
                             ": no such folder; make a calibration with dtactctl calibrate depth");
  }
  const fs::path toml = folder / kTomlName;
  const std::string text = base::read_file(toml);
  const std::string reference = base::read_file(folder / kReferenceName);
  Calibration calibration = parse(text, reference, toml.string());
  calibration.name = fs::weakly_canonical(folder).filename().string();
  return calibration;
}

void save(const Calibration& calibration, const fs::path& folder) {
  const Files files = format(calibration);
  // A trailing slash has no file name, and a link stays while the folder behind it is replaced.
  fs::path target = fs::weakly_canonical(fs::absolute(folder));
  if (!target.has_filename()) target = target.parent_path();
  if (!target.has_filename()) {
    throw std::runtime_error(folder.string() + " cannot be a calibration; name a folder");
  }
  const bool replaces = fs::exists(target);
  if (replaces) refuse_foreign(target);

  std::string name = (target.parent_path() / ("." + target.filename().string() + ".XXXXXX"));
  if (::mkdtemp(name.data()) == nullptr) fail(errno, "cannot write beside " + target.string());
  const Scratch scratch{name};
  if (::chmod(name.c_str(), 0755) != 0) fail(errno, "cannot write " + name);
  base::write_file_atomically(scratch.path() / kReferenceName, files.reference_png);
  base::write_file_atomically(scratch.path() / kTomlName, files.toml);
  if (replaces) {
    exchange(scratch.path(), target);
  } else {
    fs::rename(scratch.path(), target);
  }
  base::sync_folder(target.parent_path());
}

}  // namespace dtact::calibration
